"""What the filter of a unit did with the exposures of a camera, added up over a step."""

from __future__ import annotations

from msrr_scenes.messages import ArenaEstimate, ExposureCounts, PoseEstimate

#: Share of exposures that do not agree from which on that is told, and least number of exposures. With robots
#: of the grade ``rough`` one in a hundred does not.
_MANY, _FEW_EXPOSURES = 0.1, 20


class ExposureTally:
    """Adds up the counts of a filter, which begin anew whenever it is reset; None while there are none."""

    def __init__(self, estimate: PoseEstimate | ArenaEstimate | None) -> None:
        """Begin after what an estimate counts, which may be of an earlier step of the same filter."""
        self.counts: ExposureCounts | None = None
        self._last = (None if estimate is None else estimate.exposures) or ExposureCounts()

    def add(self, estimate: PoseEstimate | ArenaEstimate | None) -> None:
        """Add what was counted since the estimate before."""
        counts = None if estimate is None else estimate.exposures
        if counts is not None:
            self.counts = (self.counts or ExposureCounts()) + counts.since(self._last)
            self._last = counts

    def warning(self, camera: str) -> str | None:
        """Return what is to be told if many exposures of a camera do not agree with the filter."""
        counts = self.counts
        if counts is None or counts.total < _FEW_EXPOSURES or counts.disagreeing <= _MANY:
            return None
        return (
            f"{counts.total - counts.used} of {counts.total} exposures of the {camera} camera do not agree "
            "with what the filter knows: the wheels do not turn as their encoders tell, the unit or a camera "
            "is built less precisely than the tolerances say, or corners of tags are less precise than the "
            "detector tells"
        )
