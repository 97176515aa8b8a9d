"""Snapshots of a trial at any time, by interpolation between its decisions."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace

from msrr_bullet.timeline.snapshot import Snapshot, StepSnapshot
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LosObservation


class SnapshotInterpolator:
    """Snapshots of one trial, available at any time, such as the times at which cameras exposed."""

    def __init__(self, snapshots: Sequence[Snapshot]) -> None:
        """Store the snapshots, which are in order of time.

        Raises:
            MsrrError: There is no snapshot.
        """
        if not snapshots:
            raise MsrrError("a trial without a single decision has nothing to show")
        self.snapshots = tuple(snapshots)
        self._stamps = [snapshot.stamp_ns for snapshot in snapshots]

    @property
    def end_ns(self) -> int:
        """Time of the last decision."""
        return self._stamps[-1]

    def at(self, stamp_ns: int) -> Snapshot:
        """Return the trial at a time: interpolated poses and angles, the rest as at the last decision."""
        after = bisect_right(self._stamps, stamp_ns)
        a = self.snapshots[max(after - 1, 0)]
        if after in (0, len(self.snapshots)) or a.stamp_ns == stamp_ns:
            return replace(a, stamp_ns=stamp_ns)
        b = self.snapshots[after]
        fraction = (stamp_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
        units = {name: interpolate_pose(X, b.units.get(name, X), fraction) for name, X in a.units.items()}
        later = {step.key: step for step in b.steps}
        steps = tuple(_interpolate_step(step, later.get(step.key), fraction) for step in a.steps)
        return replace(a, stamp_ns=stamp_ns, units=units, steps=steps)

    def until(self, stamp_ns: int) -> Sequence[Snapshot]:
        """Return the snapshots up to a time."""
        return self.snapshots[: bisect_right(self._stamps, stamp_ns)]


def interpolate_pose(a: SE2, b: SE2, fraction: float) -> SE2:
    """Return the pose at a fraction in [0, 1] of the way from ``a`` to ``b`` at constant twist."""
    dx, dy, dyaw = (a.inverse() @ b).log()
    return a @ SE2.exp(fraction * float(dx), fraction * float(dy), fraction * float(dyaw))


def _interpolate_step(a: StepSnapshot, b: StepSnapshot | None, fraction: float) -> StepSnapshot:
    if b is None:
        return a
    estimate = a.estimate
    # Two phases may take the estimate from different sources; a pose between the two was never estimated.
    if estimate is not None and b.estimate is not None and a.phase is b.phase:
        estimate = interpolate_pose(estimate, b.estimate, fraction)
    return replace(a, estimate=estimate, los=_interpolate_los(a.los, b.los, fraction))


def _interpolate_los(
    a: LosObservation | None, b: LosObservation | None, fraction: float
) -> LosObservation | None:
    if a is None or b is None or a.status is not b.status:
        return a
    left, right = a.left + fraction * (b.left - a.left), a.right + fraction * (b.right - a.right)
    return replace(a, left=left, right=right)
