"""Time series of a trial, which plots show and tables list, computed from its snapshots."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.timeline.snapshot import Snapshot, StepSnapshot
from msrr_bullet.timeline.snapshot_builder import target_frame
from msrr_control.shapes.bodies import ACTIVE_PORT
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LosStatus, MonitorState, Phase, seconds
from msrr_scenes.specs.scene import Scene

T = TypeVar("T")
Mask = NDArray[np.bool_]

_UNKNOWN = (math.nan, math.nan)


@dataclass(frozen=True, eq=False)
class TrialSeries:
    """Time series of one trial with one row per snapshot. Unknown values are NaN.

    Attributes:
        time: Time, shape (T,) [s].
        phases: Phase of the docking unit.
        true_port: True pose of the active port before the target's port, shape (T, 3): gap between the faces
            along the axis of the dock frame D [m], offset to the left of that axis on the way in [m],
            heading [rad].
        believed_port: Estimate of ``true_port``, shape (T, 3).
        port_sigma: Standard deviations of ``believed_port`` by the estimate, shape (T, 3).
        commanded: Commanded forward velocity and turn rate, shape (T, 2) [m/s, rad/s].
        driven: True forward velocity and turn rate, shape (T, 2) [m/s, rad/s].
        sight: Angles of the target's left and right edge, shape (T, 2) [rad].
        seen: Both angles were measured in an image, shape (T,).
        clearance: Smallest distance between two bodies that may not touch, shape (T,) [m].
        off_path: Distance of the controlled point from the desired point on the path, by the unit's estimate,
            shape (T,) [m].
        true_off_path: That distance by the unit's true pose, shape (T,) [m].
        limited: The collision monitor slows the unit, shape (T,).
        stopped: The collision monitor stops the unit, shape (T,).
        avoiding: A wall beside an obstacle is in force, shape (T,).
        new_step: A step of the plan begins, shape (T,).
    """

    time: Array
    phases: tuple[Phase | None, ...]
    true_port: Array
    believed_port: Array
    port_sigma: Array
    commanded: Array
    driven: Array
    sight: Array
    seen: Mask
    clearance: Array
    off_path: Array
    true_off_path: Array
    limited: Mask
    stopped: Mask
    avoiding: Mask
    new_step: Mask

    @property
    def follows_path(self) -> bool:
        """Whether a path was followed at any time of the trial."""
        return bool(np.isfinite(self.off_path).any())

    def with_gaps(self, values: Array) -> Array:
        """Return one of the series with NaN where another unit takes over, so that no line joins the two."""
        values = np.array(values)
        values[1:][self.new_step[1:]] = np.nan
        return values

    def headings(self) -> tuple[Array, Array]:
        """Return the true and the believed heading, each of shape (T,), as continuous lines [rad].

        They have no jumps by a full turn, and are within half a turn at the end of each step of the plan.
        """
        truth, believed = self._unwrapped(self.true_port[:, 2]), self._unwrapped(self.believed_port[:, 2])
        if np.isfinite(truth).any():
            believed = truth + (believed - truth + math.pi) % (2.0 * math.pi) - math.pi
        return truth, believed

    def _unwrapped(self, angles: Array) -> Array:
        heading = angles.copy()
        for step in np.split(np.arange(len(heading)), np.flatnonzero(self.new_step)):
            known = step[np.isfinite(heading[step])]
            heading[known] = np.unwrap(heading[known][::-1])[::-1]
        return heading

    @classmethod
    def of(cls, scene: Scene, snapshots: Sequence[Snapshot]) -> TrialSeries:
        """Compute the series of snapshots in order of time, at any rate.

        Raises:
            MsrrError: There is no snapshot.
        """
        if not snapshots:
            raise MsrrError("a trial without a single snapshot has no time series")
        off = np.array([_off_path(scene, s) for s in snapshots])
        first = [s.first for s in snapshots]
        return cls(
            time=np.array([seconds(s.stamp_ns) for s in snapshots]),
            phases=tuple(s.phase for s in first),
            true_port=np.array([port_in_dock(scene, s, s.docking_pose) for s in snapshots]),
            believed_port=np.array([port_in_dock(scene, s, s.first.estimate) for s in snapshots]),
            port_sigma=np.array([_port_sigma(scene, s) for s in snapshots]),
            commanded=np.array([(s.twist.v, s.twist.w) if s.twist else _UNKNOWN for s in first]),
            driven=_driven(snapshots),
            sight=np.array([(s.los.left, s.los.right) if s.los else _UNKNOWN for s in first]),
            seen=np.array([s.los is not None and s.los.status is LosStatus.SEEN for s in first]),
            clearance=np.array([s.clearance.distance if s.clearance else math.nan for s in snapshots]),
            off_path=off[:, 0],
            true_off_path=off[:, 1],
            limited=_monitored(first, MonitorState.SLOW),
            stopped=_monitored(first, MonitorState.STOP),
            avoiding=np.array([s.assembly is not None and s.assembly.avoiding is not None for s in first]),
            new_step=np.array([True, *(a.step != b.step for a, b in pairwise(first))]),
        )


def _monitored(steps: Sequence[StepSnapshot], state: MonitorState) -> Mask:
    return np.array([s.monitor is not None and s.monitor.state is state for s in steps])


def phase_spans(
    times: Sequence[float], phases: Sequence[Phase | None]
) -> Iterator[tuple[Phase, float, float]]:
    """Yield every phase with start and end time, for phases given at a sequence of times [s]."""
    for phase, start, end in spans(times, phases):
        if phase is not None:
            yield phase, start, end


def spans(times: Sequence[float], values: Sequence[T]) -> Iterator[tuple[T, float, float]]:
    """Yield every value that stays for a while with start and end time, where the next one starts."""
    start = 0
    for value, run in groupby(values):
        end = start + len(list(run))
        yield value, times[start], times[min(end, len(times) - 1)]
        start = end


def port_in_dock(scene: Scene, snapshot: Snapshot, X_WU: SE2 | None) -> tuple[float, float, float]:
    """Return gap [m], lateral offset [m] and heading [rad] of the active port in the target's dock frame D.

    The snapshot has the true pose of the target; that of the docking unit is true or estimated.
    """
    step = snapshot.first.step
    if step is None or X_WU is None or step.target_unit not in snapshot.units:
        return math.nan, math.nan, math.nan
    X_WD = target_frame(scene, step, snapshot.units)
    X_DP = X_WD.inverse() @ X_WU @ scene.geometry(step.unit).port(step.port)
    return -X_DP.x, X_DP.y, X_DP.yaw


def _port_sigma(scene: Scene, snapshot: Snapshot) -> tuple[float, float, float]:
    """Return the standard deviations of gap [m], lateral offset [m] and heading [rad] of the active port."""
    step, first = snapshot.first.step, snapshot.first
    if step is None or first.covariance is None:
        return math.nan, math.nan, math.nan
    offset = scene.geometry(step.unit).control_offset(step.port)
    yaw = port_in_dock(scene, snapshot, first.estimate)[2]
    J = np.array([[-1.0, 0.0, offset * math.sin(yaw)], [0.0, 1.0, offset * math.cos(yaw)], [0.0, 0.0, 1.0]])
    gap, lateral, heading = np.sqrt(np.diagonal(J @ first.covariance @ J.T).clip(min=0.0)).tolist()
    return gap, lateral, heading


def _off_path(scene: Scene, snapshot: Snapshot) -> tuple[float, float]:
    """Return the estimated and the true distance of the controlled point from the desired one [m]."""
    first, X_WU = snapshot.first, snapshot.docking_pose
    if X_WU is None or (assembly := first.assembly) is None or assembly.path == 0:
        return _UNKNOWN
    port = ACTIVE_PORT if first.step is None else first.step.port
    offset = scene.geometry(first.unit).control_offset(port)
    tips = np.array([assembly.tip, X_WU.act([offset, 0.0])])
    estimated, true = np.linalg.norm(tips - np.array(assembly.desired), axis=1)
    return float(estimated), float(true)


def _driven(snapshots: Sequence[Snapshot]) -> Array:
    """Return the true velocities, each from one snapshot to the next. The last row repeats the one before."""
    rows = []
    for a, b in pairwise(snapshots):
        X, Y = a.docking_pose, b.docking_pose
        if X is None or Y is None or a.first.step != b.first.step or a.stamp_ns >= b.stamp_ns:
            rows.append(_UNKNOWN)
            continue
        forward, _, turn = (X.inverse() @ Y).log() / seconds(b.stamp_ns - a.stamp_ns)
        rows.append((float(forward), float(turn)))
    return np.array([*rows, rows[-1] if rows else _UNKNOWN])
