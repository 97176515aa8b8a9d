"""The tables that the command line prints: a trial with steps and mission, a sweep, the shipped scenes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from msrr_bullet.statistics import Quantiles, interval_text
from msrr_bullet.sweep.summary import StepFigures, SweepSummary
from msrr_bullet.trial.result import MissionFigures, TrialResult
from msrr_bullet.trial.step_result import PlanarPose, StepResult
from msrr_scenes.loading.load import find_scene, read_document
from msrr_scenes.messages import ExposureCounts
from msrr_scenes.outcome import Outcome
from msrr_scenes.wording import counted

if TYPE_CHECKING:  # it loads scipy.stats, which takes as long as half a trial
    from msrr_bullet.sweep.comparison import SweepComparison

_UNKNOWN = "-"


def _mm(metres: float | None) -> str:
    return _UNKNOWN if metres is None else f"{1000.0 * metres:z.2f} mm"


def _deg(radians: float | None) -> str:
    return _UNKNOWN if radians is None else f"{math.degrees(radians):z.2f} deg"


def _yes_no(fact: bool | None) -> str:
    return _UNKNOWN if fact is None else "yes" if fact else "no"


def _pose(pose: PlanarPose | None) -> str:
    if pose is None:
        return _UNKNOWN
    x, y = 1000.0 * pose.x_m, 1000.0 * pose.y_m
    return f"{x:+z.1f} mm, {y:+z.1f} mm, {math.degrees(pose.yaw_rad):+z.2f} deg"


def _metres(clearance: float | None) -> str:
    return _UNKNOWN if clearance is None else f"{clearance:z.3f} m"


def _title(result: TrialResult) -> str:
    return f"{result.scene}, seed {result.seed} ({result.plant}, {result.perception}, {result.as_built})"


def _name(step: StepResult) -> str:
    return f"{step.unit} {'from' if step.undocks else 'to'} {step.target}"


def _verdict(of: StepResult | TrialResult) -> Text:
    succeeded = of.succeeded if isinstance(of, StepResult) else of.docked
    return Text(of.outcome.value, "green" if succeeded else "red")


def steps_table(result: TrialResult) -> Table:
    """Return the table of a trial with a row for every step that began."""
    table = Table(title=_title(result), title_justify="left")
    for column in ("step", "belief", "truth"):  # the widest column breaks first where a terminal is narrow
        table.add_column(column, overflow="fold")
    for column in ("lateral", "attempts", "clearance", "end"):
        table.add_column(column, justify="right", overflow="fold")
    for step in result.steps:
        contact = step.contact
        table.add_row(
            _name(step),
            step.belief.replace("_", " "),
            _verdict(step),
            _mm(contact.lateral_m if contact else None),
            str(len(step.attempts)),
            _metres(step.min_clearance_m),
            f"{step.ended_s:.2f} s",
        )
    return table


def mission_table(result: TrialResult, mission: MissionFigures) -> Table:
    """Return the table of the mission of a trial as a whole."""
    table = Table(title=f"{_title(result)}: mission", title_justify="left", show_header=False)
    table.add_column(no_wrap=True)
    table.add_column()
    ways = ", ".join(f"{unit} {way:.2f}" for unit, way in mission.way_m.items())
    pair, clearance = mission.nearest_pair, _metres(mission.min_clearance_m)
    table.add_row("verdict", _verdict(result))
    table.add_row("reason", Text(result.reason))
    table.add_row("last lock", _UNKNOWN if mission.makespan_s is None else f"{mission.makespan_s:.2f} s")
    table.add_row("way driven", Text(f"{mission.total_way_m:.2f} m ({ways})"))
    table.add_row("two or more under way", f"{100 * mission.parallel_share:.0f} % of the time in motion")
    table.add_row("messages", f"{mission.messages_sent} sent, {mission.messages_lost} lost")
    table.add_row("routes planned anew", str(mission.replans))
    if mission.given_up:
        table.add_row("given up", Text(", ".join(mission.given_up), "red"))
    table.add_row("smallest clearance", Text(f"{clearance} ({pair})" if pair else clearance))
    return table


def step_table(result: TrialResult, step: StepResult) -> Table:
    """Return the table of one step of a trial, with the robot's belief beside the truth."""
    table = Table(title=f"{_title(result)}: {_name(step)}", title_justify="left")
    table.add_column("")
    table.add_column("belief")
    table.add_column("truth")
    table.add_row("verdict", step.belief.replace("_", " "), _verdict(step))
    last = step.attempts[-1]
    table.add_row("pose in dock frame", _pose(last.believed), _pose(last.true))
    contact, seating = last.contact, step.seating
    if contact is not None:
        error = contact.estimate_error
        table.add_row(
            "contact: lateral",
            _error(error.y_m if error else None, 1000.0, "mm"),
            _mm(contact.lateral_m),
        )
        yaw = _error(error.yaw_rad if error else None, math.degrees(1.0), "deg")
        table.add_row("contact: yaw", yaw, _deg(contact.yaw_rad))
    if seating is not None:
        table.add_row("gap between the faces", "", _mm(seating.axial_gap_m))
        table.add_row("seated", "", _yes_no(seating.seated))
    table.add_row(
        "lock",
        "closed" if step.lock_closed else "open",
        "holds" if step.lock_engaged else "holds nothing",
    )
    table.add_row("pull test passed", "", _yes_no(step.pull_test_passed))
    table.add_row("smallest clearance", "", _metres(step.min_clearance_m))
    for camera, seen in (("onboard", step.onboard_exposures), ("overhead", step.overhead_exposures)):
        if seen is not None:
            table.add_row(f"exposures, {camera}", _exposures(seen))
    table.add_row("attempts, time", f"{len(step.attempts)}", f"{step.ended_s - step.started_s:.2f} s")
    return table


def _exposures(seen: ExposureCounts) -> str:
    wrong = [
        f"{count} {how}"
        for count, how in ((seen.without_wheels, "without the wheels"), (seen.rejected, "rejected"))
        if count
    ]
    return ", ".join([f"{seen.used} of {seen.total} used", *wrong])


def _error(value: float | None, factor: float, unit: str) -> str:
    return _UNKNOWN if value is None else f"off by {factor * value:+z.2f} {unit}"


def sweep_table(summary: SweepSummary, overrides: Sequence[str] = ()) -> Table:
    """Return the table of a sweep; below it stand the values that were set, each ``KEY=VALUE``."""
    kind = f"{summary.plant}, {summary.perception}, {summary.as_built}"
    title = f"{summary.scene}, {counted(summary.trials, 'trial')} ({kind})"
    s = summary.success
    interval = f"95 % interval {100 * s.low:.1f} .. {100 * s.high:.1f} %"
    rate = f"{goal(summary.mission is not None)}: {100 * s.rate:.1f} %, {interval}"
    notes = [rate]
    if summary.failures:
        notes.append(_not_successes(len(summary.failures), f"not {goal(summary.mission is not None)}"))
    notes.append("below median and 95 %: their 95 % confidence intervals")
    notes += [f"--set {value}" for value in overrides]
    caption = Text("\n".join(notes), "table.caption")
    table = Table(title=title, title_justify="left", caption=caption, caption_justify="left")
    table.add_column("")
    for column in ("median", "95 %", "largest"):
        table.add_column(column, justify="right")
    for step in summary.steps:
        _add_steps(table, f"{step.unit} to {step.target}", step)
    if summary.mission is not None:
        _add_steps(table, "all docking steps", summary.mission.docks)
        if summary.mission.docks_again.trials:
            _add_steps(table, "those at a port once more", summary.mission.docks_again)
        for name, values, unit in (
            ("last lock of complete missions", summary.mission.makespan_s, "s"),
            ("way of all units", summary.mission.way_m, "m"),
            ("two or more under way", summary.mission.parallel_percent, "%"),
            ("messages lost", summary.mission.lost_percent, "%"),
            ("routes planned anew", summary.mission.replans, ""),
        ):
            table.add_row(name, *_quantiles(values, unit))
        table.add_section()
    for outcome, count in summary.outcomes.items():
        table.add_row(outcome, str(count), "", "")
    if summary.failures:
        table.add_row(Text("without a result", "red"), str(len(summary.failures)), "", "")
    table.add_row("smallest clearance", _metres(summary.min_clearance_m), "", "")
    table.add_row("starts drawn again", str(summary.redraws), "", "")
    table.add_row("taken from the store", str(summary.reused), "", "")
    return table


def _not_successes(trials: int, failed: str) -> str:
    verb = "counts" if trials == 1 else "count"
    return f"{counted(trials, 'trial')} without a result {verb} as {failed}"


def goal(coordinated: bool) -> str:
    """Return the outcome of a trial that succeeds, with a base station or without."""
    outcome = Outcome.COMPLETE if coordinated else Outcome.DOCKED
    return str(outcome.value)


def _add_steps(table: Table, name: str, step: StepFigures) -> None:
    """Add a section with the figures of a step, over the trials that began it, or of all steps."""
    docked = f"docked {step.outcomes.get(Outcome.DOCKED.value, 0)} of {step.trials}"
    table.add_row(Text(name, "bold"), docked, "", "")
    for name, values, unit in (
        ("lateral error at first contact", step.contact_lateral_mm, "mm"),
        ("yaw error at first contact", step.contact_yaw_deg, "deg"),
        ("gap between seated faces", step.seated_axial_mm, "mm"),
        ("steady tracking error", step.tracking_error_m, "m"),
        ("amplitude at an obstacle", step.amplitude_m, "m"),
        ("recovery from an obstacle", step.recovery_s, "s"),
        ("onboard exposures that disagree", step.onboard_disagreeing_percent, "%"),
        ("overhead exposures that disagree", step.overhead_disagreeing_percent, "%"),
        ("attempts", step.attempts, ""),
    ):
        if values.p50 is not None:  # else no trial has this figure
            table.add_row(name, *_quantiles(values, unit))
    table.add_section()


def _quantiles(values: Quantiles, unit: str) -> list[Text]:
    """Return the cells of three columns; below median and 95 % stand their confidence intervals."""
    digits = 3 if unit == "m" else 2
    cells = []
    for value, interval in (
        (values.p50, values.p50_interval),
        (values.p95, values.p95_interval),
        (values.max, (None, None)),
    ):
        cell = Text(_UNKNOWN if value is None else f"{value:z.{digits}f} {unit}".rstrip())
        if bounds := interval_text(interval, digits):
            cell.append(f"\n{bounds}", "dim")
        cells.append(cell)
    return cells


def comparison_table(comparison: SweepComparison, first: str, second: str) -> Table:
    """Return the table of two sweeps, which are called by their names."""
    trials = comparison.trials
    left_out = [
        f"{counted(count, 'seed')} only in {name}"
        for name, count in ((first, comparison.only_first), (second, comparison.only_second))
        if count
    ]
    notes = [
        "difference: second minus first; below it its 95 % interval, which tells the two apart"
        " unless it holds 0",
        "p: probability of as large a difference by chance",
    ]
    for name, trials_without in zip((first, second), comparison.without_result, strict=True):
        if trials_without:
            notes.append(f"{name}: {_not_successes(trials_without, 'not succeeded')}")
    if not comparison.is_of_one_scene:
        notes.append(
            f"the scenes are {' and '.join(comparison.scenes)}: trials with the same seed share what their"
            " scenes have in common, and no more"
        )
    for what, kinds in (("plants", comparison.plants), ("kinds of perception", comparison.perceptions)):
        if len({*kinds} - {""}) > 1:
            notes.append(
                f"the {what} are {' and '.join(kinds)}: a difference may be theirs alone, and not that of the"
                " robots or controllers"
            )
    table = Table(
        title="; ".join([f"{counted(trials, 'trial')} with the same seeds", *left_out]),
        title_justify="left",
        caption="\n".join(notes),
        caption_justify="left",
    )
    table.add_column("")
    for column in (first, second, "difference"):
        table.add_column(Text(column), justify="right", overflow="fold")
    table.add_row(
        "succeeded", *(f"{count} of {trials}" for count in comparison.succeeded), f"p = {comparison.p:.2g}"
    )
    table.add_row("succeeded here alone", *map(str, comparison.succeeded_alone), "")
    for figure in comparison.figures:
        table.add_section()
        table.add_row(Text(figure.name, "bold"), *[""] * 2, counted(figure.trials, "trial"))
        digits = 3 if figure.unit == "m" else 2
        for q in figure.quantiles:
            name = "median" if q.q == 0.5 else f"{100 * q.q:.0f} %"
            cells = (f"{v:z.{digits}f} {figure.unit}".rstrip() for v in (q.first, q.second))
            value, *bounds = (f"{v:+z.{digits}f}" for v in (q.difference, *(q.interval or ())))
            style = "bold" if q.is_apart else ""
            below = " .. ".join(bounds) or "too few trials"
            table.add_row(f"  {name}", *cells, Text(value, style).append(f"\n{below}", "dim"))
    return table


def scenes_table(names: tuple[str, ...]) -> Table:
    """Return the table of shipped scenes with their descriptions."""
    table = Table(title="Shipped scenes", title_justify="left")
    table.add_column("scene", no_wrap=True)
    table.add_column("description")
    for name in names:
        table.add_row(name, read_document(find_scene(name)).data["description"])
    return table
