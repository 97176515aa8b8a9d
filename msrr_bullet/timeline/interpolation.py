"""A trial at any time: between two decisions, where bodies and belief were on the way."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace

from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LosObservation


class Moments:
    """The instants of a trial, to be asked for at the times at which cameras exposed."""

    def __init__(self, frames: Sequence[Snapshot]) -> None:
        """Take the instants in order.

        Raises:
            MsrrError: There is not a single one.
        """
        if not frames:
            raise MsrrError("a trial without a single decision has nothing to show")
        self.frames = tuple(frames)
        self._stamps = [frame.stamp_ns for frame in frames]

    @property
    def end_ns(self) -> int:
        """Time of the last decision."""
        return self._stamps[-1]

    def at(self, stamp_ns: int) -> Snapshot:
        """Return the trial at a time; poses and angles in between are interpolated, all else is in force."""
        after = bisect_right(self._stamps, stamp_ns)
        a = self.frames[max(after - 1, 0)]
        if after in (0, len(self.frames)) or a.stamp_ns == stamp_ns:
            return replace(a, stamp_ns=stamp_ns)
        b = self.frames[after]
        share = (stamp_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
        units = {name: between(X, b.units.get(name, X), share) for name, X in a.units.items()}
        estimate = a.estimate
        # Two phases may believe by different sources: what lies between them nobody has believed.
        if estimate is not None and b.estimate is not None and a.phase is b.phase and a.step == b.step:
            estimate = between(estimate, b.estimate, share)
        return replace(a, stamp_ns=stamp_ns, units=units, estimate=estimate, los=_sight(a.los, b.los, share))

    def until(self, stamp_ns: int) -> Sequence[Snapshot]:
        """Return the instants up to a time."""
        return self.frames[: bisect_right(self._stamps, stamp_ns)]


def between(a: SE2, b: SE2, share: float) -> SE2:
    """Return the pose at ``share`` in [0, 1] of the way from one to the other at constant twist."""
    dx, dy, dyaw = (a.inverse() @ b).log()
    return a @ SE2.exp(share * float(dx), share * float(dy), share * float(dyaw))


def _sight(a: LosObservation | None, b: LosObservation | None, share: float) -> LosObservation | None:
    if a is None or b is None or a.status is not b.status:
        return a
    return replace(a, left=a.left + share * (b.left - a.left), right=a.right + share * (b.right - a.right))
