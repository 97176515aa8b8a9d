"""The trials of a sweep as one table, with a row for every step, for programs that read CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping

from msrr_bullet.export.table import Row, columns, exposure_cells, exposures, text
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.step_result import StepResult

TRIAL_COLUMNS = columns(
    scene="name of the scene",
    seed="seed of the trial",
    outcome="how the trial ended; empty, as duration_s, plant, perception and as_built, without a result",
    reason="why it ended so; for a trial without a result, what happened",
    duration_s="simulated time of the trial",
    plant="plant of the scene: bullet or unicycle",
    perception="perception of the scene: images or parametric",
    as_built="grade of the workmanship, with the quantities that are not as the grade has them",
    scene_hash="digest of all that the scene says, overrides included, and of the files that it names",
    step="index of the step, from 0; empty, as all that follow, for a trial in which no step began",
    unit="name of the docking unit",
    target="port that is docked to, or undocked from",
    undocks="1 when the task was to undock",
    step_outcome="verdict of the judge on the step",
    belief="belief of the robot about the step",
    step_reason="why the judge, or else the robot, ended the step",
    started_s="simulated time at which the step began",
    ended_s="simulated time at which the step ended",
    attempts="number of attempts",
    contact_s="simulated time at which a pin first touched the target in the last attempt",
    contact_lateral_m="true distance of the port of the unit from the docking axis at that contact",
    contact_yaw_rad="true angle between that port and the docking axis then",
    contact_y_m="where that port was then beside the docking axis, to the left positive",
    contact_heading_rad="its heading against the docking axis then, counter-clockwise positive",
    contact_estimate_error_y_m="estimate minus truth of the offset of the axle to the left of the axis then",
    contact_estimate_error_yaw_rad="estimate minus truth of its heading then",
    seated="1 when the unit was seated at the end, 0 when it was not; empty where it was not at the port",
    seated_axial_m="true distance between the faces at the end, seated or not; empty where seated is",
    pull_test_passed="1 when the lock held the pull test, 0 when it did not; empty without a test",
    min_clearance_m="true smallest distance in the step of two bodies that were neither docking nor locked",
    tracking_error_m="steady tracking error of the long-distance phase",
    amplitude_m="largest distance from the desired point while the unit passed an obstacle",
    recovery_s="time from that peak until the distance stayed below 5 cm",
    **exposures("onboard_", "exposures of the unit's own camera"),
    **exposures("overhead_", "exposures of the overhead camera that show the unit"),
)


def trials_csv(
    outcomes: Iterable[TrialResult | TrialFailure], values: Mapping[str, Mapping[str, str]] | None = None
) -> str:
    """Return the table of trials as CSV: a header with :data:`TRIAL_COLUMNS`, and the rows of each trial.

    ``values`` are those that were set, by dotted key, of every scene by its hash. A column for each of these
    keys follows the others, named ``set.<key>``: a key may have the name of one of those.
    """
    values = values or {}
    keys = list(dict.fromkeys(key for given in values.values() for key in given))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*(column.name for column in TRIAL_COLUMNS), *(f"set.{key}" for key in keys)])
    for outcome in outcomes:
        given = values.get(outcome.scene_hash, {})
        for row in _rows(outcome):
            cells = [*row, *[None] * (len(TRIAL_COLUMNS) - len(row)), *(given.get(key) for key in keys)]
            writer.writerow([text(cell) for cell in cells])
    return out.getvalue()


def _rows(outcome: TrialResult | TrialFailure) -> Iterator[Row]:
    if isinstance(outcome, TrialFailure):
        yield (outcome.scene, outcome.seed, None, outcome.error, *[None] * 4, outcome.scene_hash)
        return
    trial = (
        *(outcome.scene, outcome.seed, outcome.outcome, outcome.reason, outcome.duration_s),
        *(outcome.plant, outcome.perception, outcome.as_built, outcome.scene_hash),
    )
    if not outcome.steps:
        yield trial
    for step in outcome.steps:
        yield *trial, *_step_cells(step)


def _step_cells(step: StepResult) -> Row:
    contact, seating, figures = step.contact, step.seating, step.assembly
    error = None if contact is None else contact.estimate_error
    return (
        *(step.index, step.unit, step.target, step.undocks, step.outcome, step.belief),
        *(step.reason, step.started_s, step.ended_s, len(step.attempts)),
        *((contact.time_s, contact.lateral_m, contact.yaw_rad) if contact else (None,) * 3),
        *((contact.port.y_m, contact.port.yaw_rad) if contact else (None,) * 2),
        *((error.y_m, error.yaw_rad) if error else (None,) * 2),
        *((seating.seated, seating.axial_gap_m) if seating else (None,) * 2),
        *(step.pull_test_passed, step.min_clearance_m),
        *((figures.tracking_error_m, figures.amplitude_m, figures.recovery_s) if figures else (None,) * 3),
        *exposure_cells(step.onboard_exposures),
        *exposure_cells(step.overhead_exposures),
    )
