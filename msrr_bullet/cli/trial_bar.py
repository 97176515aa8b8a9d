"""The progress of many trials on the console."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

from rich.progress import Progress

from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene


class TrialBar:
    """A bar that counts the trials that have ended; what did not succeed is named above it.

    Each label tells a scene from the others, in words; that of an only one is empty. ``trials`` counts those
    of all scenes.
    """

    def __init__(self, bar: Progress, scenes: Sequence[Scene], labels: Sequence[str], trials: int) -> None:
        self._labels = {scene_hash(scene): label for scene, label in zip(scenes, labels, strict=True)}
        self._bar, self._name = bar, scenes[0].name
        goals = (Outcome.COMPLETE if scene.coordinated else Outcome.DOCKED for scene in scenes)
        self._goal = " or ".join(dict.fromkeys(goal.value for goal in goals))
        self._task = bar.add_task(self._name, total=trials)
        self._succeeded = 0

    def checking(
        self, scenes: Sequence[Scene], seeds: Sequence[int]
    ) -> Iterator[tuple[Scene, Sequence[int]]]:
        """Yield each scene with its seeds, which is checked then, and show how many have been.

        A thousand scenes may take a minute, in which no trial begins.
        """
        for number, scene in enumerate(scenes, 1):
            if len(scenes) > 1:
                description = f"{self._name}, checking scene {number} of {len(scenes)}"
                self._bar.update(self._task, description=description)
            yield scene, seeds
        self._bar.update(self._task, description=self._name)

    def show(self, outcome: TrialResult | TrialFailure, stored: bool) -> None:
        """Show a trial that has ended; an observer of sweeps."""
        label = self._labels.get(outcome.scene_hash)  # none if a file of the scene was written since
        trial = f"{label}, seed {outcome.seed}" if label else f"seed {outcome.seed}"
        if isinstance(outcome, TrialFailure):
            self._print(f"{trial}: {outcome.error}", style="red")
        elif outcome.docked:
            self._succeeded += 1
        else:
            self._print(f"{trial}: {outcome.outcome.value}, {outcome.reason}")
        description = f"{self._name}, {self._succeeded} {self._goal}"
        self._bar.update(self._task, advance=1, description=description)

    def _print(self, text: str, style: str | None = None) -> None:
        # Trials go on where nobody reads of them any more; the table at the end tells of the error.
        with suppress(OSError):
            self._bar.console.print(text, style=style, highlight=False, soft_wrap=True)
