"""The trials of a sweep that have ended, and the summaries of what there is of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from msrr_bullet.sweep.provenance import code_fingerprint, own_code
from msrr_bullet.sweep.summarise import summarise
from msrr_bullet.sweep.summary import SweepSummary, TrialFailure
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.specs.scene import Scene


class EndedTrials:
    """The trials of one scene or of several, over the same seeds, that have ended.

    It is made before any trial begins, for it notes the code that is in force.
    """

    def __init__(self, scenes: Sequence[Scene], seeds: Sequence[int]) -> None:
        own = own_code()
        self._codes = [code_fingerprint(scene, own=own) for scene in scenes]
        self._hashes = [scene_hash(scene) for scene in scenes]
        self._scenes, self._seeds = scenes, seeds
        self._ended: dict[tuple[str, int], TrialResult | TrialFailure] = {}
        self._reused = Counter[str]()

    def add(self, outcome: TrialResult | TrialFailure, stored: bool) -> None:
        """Add a trial that has ended, or that is taken from a store; an observer of :func:`run_trials`."""
        self._ended[outcome.scene_hash, outcome.seed] = outcome
        self._reused[outcome.scene_hash] += stored

    def outcomes(self) -> list[TrialResult | TrialFailure]:
        """Return those that have ended, in the order of the scenes and of their seeds."""
        return [outcome for digest in self._hashes for outcome in self._of(digest)]

    def summaries(self, *, interrupted: bool = False) -> list[SweepSummary]:
        """Return the summary of every scene; ``interrupted`` is that of a :class:`~.summary.SweepSummary`."""
        return [
            summarise(scene, code, self._of(digest), reused=self._reused[digest], interrupted=interrupted)
            for scene, code, digest in zip(self._scenes, self._codes, self._hashes, strict=True)
        ]

    def _of(self, digest: str) -> list[TrialResult | TrialFailure]:
        return [self._ended[digest, seed] for seed in self._seeds if (digest, seed) in self._ended]
