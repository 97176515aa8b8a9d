"""A trial of the real loop with the paper's figures, and the shelf on which such trials are kept."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pydantic import Field, ValidationError

from msrr_bullet.long_series import LongSeries
from msrr_bullet.provenance import code_fingerprint
from msrr_bullet.reproduce.measures import SETTLED_M
from msrr_bullet.reproduce.trial_series import CloseSeries, SeriesRecorder
from msrr_bullet.result import TrialResult
from msrr_scenes.errors import MsrrError
from msrr_scenes.load import scene_hash
from msrr_scenes.scene import Scene


class MeasuredTrial(TrialResult):
    """A trial's result with the measures of both phases that it has.

    Attributes:
        measures: By key, see :mod:`msrr_bullet.reproduce.measures`, in SI.
        kept_in_view: The target stayed in the outer cone during the last approach; None without one.
    """

    measures: dict[str, float] = Field(default_factory=dict)
    kept_in_view: bool | None = None


def record_trial(scene: Scene, seed: int) -> tuple[TrialResult, LongSeries | None, CloseSeries | None]:
    """Run a trial and return its result and the series of its last step's two phases."""
    # The simulator is loaded where trials run, not where they are asked for.
    from msrr_bullet.trial import Trial

    step = scene.plan[-1]
    recorder = SeriesRecorder(step.unit)
    result = Trial(scene, seed, recorder=recorder).run()
    offset = scene.geometry(step.unit).control_offset(step.port)
    contact_s = result.contact.time_s if result.contact is not None else None
    return (
        result,
        LongSeries.of(recorder.instants, step.unit, offset),
        CloseSeries.of(recorder.instants, scene, contact_s),
    )


def measured_trial(scene: Scene, seed: int) -> MeasuredTrial:
    """Run a trial and measure it; a :data:`msrr_bullet.sweep.TrialFunction`."""
    result, long, close = record_trial(scene, seed)
    measures: dict[str, float] = {}
    if long is not None:
        measures.update(long.measures())
    if close is not None:
        measures.update(close.measures(SETTLED_M))
    if result.contact is not None:
        measures["lateral"], measures["yaw"] = result.contact.lateral_m, result.contact.yaw_rad
    values = {name: getattr(result, name) for name in TrialResult.model_fields}
    kept = close.kept_in_view(scene.los.outer) if close is not None else None
    return MeasuredTrial(**values, measures=measures, kept_in_view=kept)


class Shelf:
    """Keeps measured trials of one scene in a file of one JSON line each, so that a stopped run resumes."""

    def __init__(self, folder: Path, scene: Scene) -> None:
        """Use the file of this scene and this code in ``folder``."""
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / f"{scene_hash(scene)[:12]}-{code_fingerprint(scene)[:12]}.jsonl"
        if self.path.is_file():  # a killed run may have left half a line
            kept, newline, torn = self.path.read_bytes().rpartition(b"\n")
            if torn:
                self.path.write_bytes(kept + newline)

    def __iter__(self) -> Iterator[MeasuredTrial]:
        """Iterate over what is kept.

        Raises:
            MsrrError: A line is no trial.
        """
        if not self.path.is_file():
            return
        for number, line in enumerate(self.path.read_text(encoding="utf-8").splitlines(), start=1):
            try:
                yield MeasuredTrial.model_validate_json(line)
            except ValidationError as error:
                raise MsrrError(f"{self.path}:{number}: not a measured trial; remove the file") from error

    def put(self, trial: MeasuredTrial) -> None:
        """Keep a trial."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(trial.model_dump_json() + "\n")
