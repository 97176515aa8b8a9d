"""The tables that the command line prints of many trials: a sweep, a variation, two sweeps compared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from msrr_bullet.statistics import Quantiles, interval_text
from msrr_bullet.sweep.summary import StepFigures, SweepSummary
from msrr_scenes.outcome import Outcome
from msrr_scenes.wording import counted

if TYPE_CHECKING:  # it loads scipy.stats, which takes as long as half a trial
    from msrr_bullet.sweep.comparison import SweepComparison
    from msrr_bullet.sweep.variation import Variation

_UNKNOWN = "-"

#: What a column of a table takes beside its text, in characters: a line, and a space on both sides.
_BORDER = 3


def sweep_table(summary: SweepSummary, overrides: Sequence[str] = ()) -> Table:
    """Return the table of a sweep; below it stand the values that were set, each ``KEY=VALUE``."""
    kind = f"{summary.plant}, {summary.perception}, {summary.as_built}"
    title = f"{summary.scene}, {counted(summary.trials, 'trial')} ({kind})"
    s = summary.success
    interval = f"95 % interval {100 * s.low:.1f} .. {100 * s.high:.1f} %"
    rate = f"{summary.goal.value}: {100 * s.rate:.1f} %, {interval}"
    notes = [rate]
    if summary.failures:
        notes.append(_not_successes(len(summary.failures), f"not {summary.goal.value}"))
    notes.append("below median and 95 %: their 95 % confidence intervals")
    notes += [f"--set {value}" for value in overrides]
    caption = Text("\n".join(notes), "table.caption")
    table = Table(title=title, title_justify="left", caption=caption, caption_justify="left")
    table.add_column("")
    for column in ("median", "95 %", "largest"):
        table.add_column(column, justify="right")
    for name, figures in summary.docking_steps:
        _add_steps(table, name, figures)
    if summary.mission is not None:
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
    least = summary.min_clearance_m
    table.add_row("smallest clearance", _UNKNOWN if least is None else f"{least:z.3f} m", "", "")
    table.add_row("starts drawn again", str(summary.redraws), "", "")
    table.add_row("taken from the store", str(summary.reused), "", "")
    return table


def variation_table(variation: Variation, width: int, overrides: Sequence[str] = ()) -> Table:
    """Return the table of a variation; below it stand the values that were set at all levels.

    The console is ``width`` characters wide; each of these values is ``KEY=VALUE``.
    """
    failures = sum(len(level.summary.failures) for level in variation.levels)
    notes = [_not_successes(failures, f"not {variation.goal}")] if failures else []
    notes += [
        "below: 95 % confidence intervals, those of rates in percent",
        *(f"--set {value}" for value in overrides),
    ]
    caption = Text("\n".join(notes), "table.caption")
    table = Table(title=variation.title, title_justify="left", caption=caption, caption_justify="left")
    head, rows = variation.head(), variation.rows()
    whole = _one_word_columns([head, *([" ".join(cell) for cell in row] for row in rows)], width)
    for title, kept in zip(head, whole, strict=True):
        table.add_column(Text(title), justify="right", overflow="fold", no_wrap=kept)
    for row in rows:
        table.add_row(*(_with_bounds(text, bounds) for text, bounds in row))
    return table


def _one_word_columns(rows: Sequence[Sequence[str]], width: int) -> list[bool]:
    """Return of each column whether it holds single words, for which the console has room.

    Rich makes all columns equally narrow where a table is too wide, and would break these words; other texts
    it breaks between their words. Where the latter would have too little room, it may do as it likes.
    """
    words = [[text.split() for text in column] for column in zip(*rows, strict=True)]
    longest = [max(len(word) for text in column for word in text) for column in words]
    single = [all(len(text) <= 1 for text in column) for column in words]
    left = width - 1 - sum(_BORDER + single[i] * longest[i] for i in range(len(longest)))
    others = [length for length, alone in zip(longest, single, strict=True) if not alone]
    fits = left >= len(others) * max(others, default=0)
    return [alone and fits for alone in single]


def _not_successes(trials: int, failed: str) -> str:
    verb = "counts" if trials == 1 else "count"
    return f"{counted(trials, 'trial')} without a result {verb} as {failed}"


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
        text = _UNKNOWN if value is None else f"{value:z.{digits}f} {unit}".rstrip()
        cells.append(_with_bounds(text, interval_text(interval, digits)))
    return cells


def _with_bounds(text: str, bounds: str) -> Text:
    """Return a cell with a confidence interval, if there is one, below its value."""
    return Text(text).append(f"\n{bounds}", "dim") if bounds else Text(text)


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
