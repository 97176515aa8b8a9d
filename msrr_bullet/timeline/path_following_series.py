"""Time series of the long-distance phase of one trial, and the measures that the paper reports of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from msrr_control.kinematics.controlled_point import offset_point
from msrr_control.studies import metrics
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Action, AssemblyProgress, LosObservation, PoseEstimate, seconds

#: Stages of the long-distance phase in which a path is followed.
_FOLLOWING = ("drive", "settle")


@dataclass(slots=True)
class ControlInstant:
    """One control instant of a trial: a decision, what it was taken on, and true poses ``X_WB`` by body."""

    action: Action
    estimate: PoseEstimate | None = None
    los: LosObservation | None = None
    assembly: AssemblyProgress | None = None
    true: dict[str, SE2] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PathFollowingSeries:
    """Time series of the long-distance phase of one trial, in the world frame W.

    Attributes:
        time: Shape (T,) [s].
        tip: True controlled point, shape (T, 2) [m].
        desired: Desired point on the path, as logged by the unit, shape (T, 2) [m].
        path: Number of the path that is followed, shape (T,).
        walled: An obstacle was being passed, shape (T,).
        arc_end: Time at which the desired point reached the end of the last arc of the last path [s]; NaN if
            it never did.
    """

    time: Array
    tip: Array
    desired: Array
    path: NDArray[np.int64]
    walled: NDArray[np.bool_]
    arc_end: float

    @classmethod
    def of(cls, instants: list[ControlInstant], unit: str, offset: float) -> PathFollowingSeries | None:
        """Return the series of the instants at which a path was followed; None when none was.

        ``offset`` is the distance of the controlled point ahead of the axle [m].
        """
        followed = [
            (i, i.assembly)
            for i in instants
            if i.assembly is not None and i.assembly.stage in _FOLLOWING and unit in i.true
        ]
        if not followed:
            return None
        pose = np.array([i.true[unit].as_array() for i, _ in followed])
        last = followed[-1][1].path
        past = [i for i, a in followed if a.path == last and 0.0 < a.arc_end <= a.s]
        return cls(
            time=np.array([seconds(i.action.stamp_ns) for i, _ in followed]),
            tip=offset_point(pose, offset),
            desired=np.array([a.desired for _, a in followed]),
            path=np.array([a.path for _, a in followed]),
            walled=np.array([a.avoiding is not None for _, a in followed]),
            arc_end=seconds(past[0].action.stamp_ns) if past else math.nan,
        )

    def from_path(self) -> Array:
        """Return the distance of the controlled point from the path that is followed, shape (T,) [m].

        The path is taken as the polygon through the desired points, which lie a few millimetres apart. An arc
        of this size is straight between two of them to within some micrometres.
        """
        distance = np.empty(len(self.time))
        for number in np.unique(self.path):
            rows = self.path == number
            distance[rows] = metrics.from_line(self.tip[rows], self.desired[rows])
        return distance

    def measures(self) -> dict[str, float]:
        """Return the measures of the long-distance phase that are defined for this trial, by name.

        A recovery that the trial did not see is infinite.
        """
        off, beside = metrics.deviation(self.tip, self.desired), self.from_path()
        found = metrics.figures(self.time, off, beside, np.array(self.arc_end), self.walled)
        return {key: float(value) for key, value in found.items() if not np.isnan(value)}
