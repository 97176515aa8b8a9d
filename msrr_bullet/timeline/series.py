"""The time series of a trial: what plots show and tables list, from the instants of its log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.timeline.snapshot import Snapshot, meant_to_touch
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LosStatus, Phase, seconds
from msrr_scenes.specs.scene import Scene

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Series:
    """One row for each decision; NaN where there is nothing to tell.

    Attributes:
        time: Since the start, shape (T,) [s].
        phases: Phase of the docking unit.
        true_port: Where its active port truly is before the target's: gap between the faces along the axis
            of the dock frame D [m], offset to the left of the axis on the way in [m], heading [rad]; (T, 3).
        believed_port: The same as the unit believes, shape (T, 3).
        commanded: Forward velocity and turn rate that it commands, shape (T, 2) [m/s, rad/s].
        driven: The same as it truly moves, shape (T, 2).
        sight: Angles of the target's left and right edge, shape (T, 2) [rad].
        seen: Where these were measured in an image, shape (T,).
        clearance: Smallest distance between any two bodies, shape (T,) [m].
        docking_pair: Where that is the distance of a pair that is meant to touch, shape (T,).
        off_path: Distance of the controlled point from where on the path it should be, as the unit has it,
            shape (T,) [m].
        truly_off_path: The same from the unit's true pose, shape (T,) [m].
        avoiding: Where a wall beside an obstacle stands, shape (T,).
        new_step: Where a step of the plan begins, shape (T,).
    """

    time: Array
    phases: tuple[Phase | None, ...]
    true_port: Array
    believed_port: Array
    commanded: Array
    driven: Array
    sight: Array
    seen: Mask
    clearance: Array
    docking_pair: Mask
    off_path: Array
    truly_off_path: Array
    avoiding: Mask
    new_step: Mask

    @property
    def assembles(self) -> bool:
        """The trial has a long-distance phase that got as far as following a path."""
        return bool(np.isfinite(self.off_path).any())

    def torn(self, values: Array) -> Array:
        """Return one of the series with a gap where another unit takes over: no line joins the two."""
        torn = np.array(values)
        torn[1:][self.new_step[1:]] = np.nan
        return torn

    @classmethod
    def of(cls, scene: Scene, frames: Sequence[Snapshot]) -> Series:
        """Gather the series.

        Args:
            scene: The scene of the trial.
            frames: Instants in order, at any rate.

        Raises:
            MsrrError: There is not a single one.
        """
        if not frames:
            raise MsrrError("a trial without a single frame has no time series")
        off = np.array([_off_path(scene, f) for f in frames])
        return cls(
            time=np.array([seconds(f.stamp_ns - frames[0].stamp_ns) for f in frames]),
            phases=tuple(f.phase for f in frames),
            true_port=np.array([port_in_dock(scene, f, acting_pose(f)) for f in frames]),
            believed_port=np.array([port_in_dock(scene, f, f.estimate) for f in frames]),
            commanded=np.array([(f.twist.v, f.twist.w) if f.twist else _NOTHING for f in frames]),
            driven=_driven(frames),
            sight=np.array([(f.los.left, f.los.right) if f.los else _NOTHING for f in frames]),
            seen=np.array([f.los is not None and f.los.status is LosStatus.SEEN for f in frames]),
            clearance=np.array([f.clearance.distance if f.clearance else math.nan for f in frames]),
            docking_pair=np.array([meant_to_touch(f) for f in frames]),
            off_path=off[:, 0],
            truly_off_path=off[:, 1],
            avoiding=np.array([f.assembly is not None and f.assembly.avoiding is not None for f in frames]),
            new_step=np.array([True, *(a.step != b.step for a, b in pairwise(frames))]),
        )


_NOTHING = (math.nan, math.nan)


def acting_pose(frame: Snapshot) -> SE2 | None:
    """Return the true pose of the docking unit, ``X_WU``."""
    return frame.units.get(frame.step.unit) if frame.step else None


def port_in_dock(scene: Scene, frame: Snapshot, X_WU: SE2 | None) -> tuple[float, float, float]:
    """Return gap [m], lateral offset [m] and heading [rad] of the active port in the target's dock frame D.

    Args:
        scene: The scene of the trial.
        frame: Says where the target truly is.
        X_WU: Where the docking unit is, or is believed.
    """
    step = frame.step
    if step is None or X_WU is None or step.target_unit not in frame.units:
        return math.nan, math.nan, math.nan
    X_WD = frame.units[step.target_unit] @ scene.geometry(step.target_unit).dock_frame(step.target_port)
    X_DP = X_WD.inverse() @ X_WU @ scene.geometry(step.unit).port(step.port)
    return -X_DP.x, X_DP.y, X_DP.yaw


def _off_path(scene: Scene, frame: Snapshot) -> tuple[float, float]:
    """Return how far the controlled point is off the desired one [m], as believed and in truth."""
    assembly, X_WU = frame.assembly, acting_pose(frame)
    if assembly is None or assembly.path == 0 or frame.step is None or X_WU is None:
        return _NOTHING
    offset = scene.geometry(frame.step.unit).control_offset(frame.step.port)
    tips = np.array([assembly.tip, X_WU.act([offset, 0.0])])
    believed, true = np.linalg.norm(tips - np.array(assembly.desired), axis=1)
    return float(believed), float(true)


def _driven(frames: Sequence[Snapshot]) -> Array:
    """Return the true velocities, each between a frame and the next; the last one repeats."""
    rows = []
    for a, b in pairwise(frames):
        X, Y = acting_pose(a), acting_pose(b)
        if X is None or Y is None or a.step != b.step or a.stamp_ns >= b.stamp_ns:
            rows.append(_NOTHING)
            continue
        forward, _, turn = (X.inverse() @ Y).log() / seconds(b.stamp_ns - a.stamp_ns)
        rows.append((float(forward), float(turn)))
    return np.array([*rows, rows[-1] if rows else _NOTHING])
