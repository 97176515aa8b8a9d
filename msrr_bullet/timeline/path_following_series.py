"""The long-distance phase of one trial as time series, and the paper's figures of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from msrr_control.kinematics.offset_point import offset_point
from msrr_control.studies import metrics
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Action, AssemblyProgress, LosObservation, PoseEstimate, seconds

#: Stages of the long-distance phase in which a path is followed.
_UNDER_WAY = ("drive", "settle")


@dataclass(slots=True)
class Instant:
    """One control instant: the decision, what it was taken on, and the truth then."""

    action: Action
    estimate: PoseEstimate | None = None
    los: LosObservation | None = None
    assembly: AssemblyProgress | None = None
    true: dict[str, SE2] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PathFollowingSeries:
    """The long-distance phase of one trial, truth in W.

    Attributes:
        time: Shape (T,) [s].
        pose: True axle pose, shape (T, 3).
        tip: True controlled point, shape (T, 2) [m].
        desired: Desired point, as the unit had it, shape (T, 2) [m].
        command: (v, w), shape (T, 2).
        path: Number of the path under way, shape (T,).
        walled: An obstacle was being passed, shape (T,).
        arc_end: When the desired point ended the last arc of the last path [s]; NaN if it never did.
    """

    time: Array
    pose: Array
    tip: Array
    desired: Array
    command: Array
    path: NDArray[np.int64]
    walled: NDArray[np.bool_]
    arc_end: float

    @classmethod
    def of(cls, instants: list[Instant], unit: str, offset: float) -> PathFollowingSeries | None:
        """Select the instants at which a path was followed; None if there were not any."""
        way = [(i, i.assembly) for i in instants if i.assembly is not None and i.assembly.stage in _UNDER_WAY]
        way = [(i, a) for i, a in way if unit in i.true]
        if not way:
            return None
        pose = np.array([i.true[unit].as_array() for i, _ in way])
        last = way[-1][1].path
        past = [i for i, a in way if a.path == last and 0.0 < a.arc_end <= a.s]
        return cls(
            time=np.array([seconds(i.action.stamp_ns) for i, _ in way]),
            pose=pose,
            tip=offset_point(pose, offset),
            desired=np.array([a.desired for _, a in way]),
            command=np.array([[i.action.twist.v, i.action.twist.w] for i, _ in way]),
            path=np.array([a.path for _, a in way]),
            walled=np.array([a.avoiding is not None for _, a in way]),
            arc_end=seconds(past[0].action.stamp_ns) if past else math.nan,
        )

    def from_path(self) -> Array:
        """Distance of the controlled point from the path under way, shape (T,) [m].

        The path is what the desired point went along, every few millimetres of it; between two instants an
        arc of this size is straight to some micrometres.
        """
        distance = np.empty(len(self.time))
        for number in np.unique(self.path):
            under_way = self.path == number
            distance[under_way] = metrics.from_line(self.tip[under_way], self.desired[under_way])
        return distance

    def measures(self) -> dict[str, float]:
        """Return the measures of the long phase that this trial has."""
        off, beside = metrics.deviation(self.tip, self.desired), self.from_path()
        episode = metrics.obstacle_episode(self.time, off, self.walled)
        found = {
            "tracking": metrics.tracking_error(self.time, off, np.array(self.arc_end), episode),
            "amplitude": metrics.amplitude(off, episode),
            "amplitude_path": metrics.amplitude(beside, episode),
            "recovery": metrics.recovery_time(self.time, off, episode),
            "recovery_path": metrics.recovery_time(self.time, beside, episode),
        }
        return {key: float(value) for key, value in found.items() if np.isfinite(value)}
