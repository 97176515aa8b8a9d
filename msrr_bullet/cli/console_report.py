"""The tables that the command line prints: a trial's belief and truth, a sweep, the shipped scenes."""

from __future__ import annotations

import math

from rich.table import Table
from rich.text import Text

from msrr_bullet.statistics import Quantiles
from msrr_bullet.sweep.summary import SweepSummary
from msrr_bullet.trial.result import PlanarPose, TrialResult
from msrr_scenes.loading.load import load_scene

_UNKNOWN = "-"


def _mm(metres: float | None) -> str:
    return _UNKNOWN if metres is None else f"{1000.0 * metres:.2f} mm"


def _deg(radians: float | None) -> str:
    return _UNKNOWN if radians is None else f"{math.degrees(radians):.2f} deg"


def _yes_no(fact: bool | None) -> str:
    return _UNKNOWN if fact is None else "yes" if fact else "no"


def _pose(pose: PlanarPose | None) -> str:
    if pose is None:
        return _UNKNOWN
    x, y = 1000.0 * pose.x_m, 1000.0 * pose.y_m
    return f"{x:+.1f} mm, {y:+.1f} mm, {math.degrees(pose.yaw_rad):+.2f} deg"


def trial_table(result: TrialResult) -> Table:
    """Return the table of a trial, with the robot's belief beside the truth."""
    title = f"{result.scene}, seed {result.seed} ({result.plant}, {result.perception})"
    table = Table(title=title, title_justify="left")
    table.add_column("")
    table.add_column("belief")
    table.add_column("truth")
    colour = "green" if result.docked else "red"
    table.add_row("verdict", result.belief.replace("_", " "), Text(result.outcome.value, colour))
    last = result.records[-1] if result.records else None
    table.add_row(
        "pose in dock frame", _pose(last.believed if last else None), _pose(last.true if last else None)
    )
    contact, seating = result.contact, result.seating
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
        "closed" if result.lock_closed else "open",
        "holds" if result.lock_engaged else "holds nothing",
    )
    table.add_row("pull test passed", "", _yes_no(result.pull_test_passed))
    clearance = result.min_clearance_m
    table.add_row("smallest clearance", "", _UNKNOWN if clearance is None else f"{clearance:.3f} m")
    table.add_row("attempts, time", f"{result.attempts}", f"{result.duration_s:.2f} s")
    return table


def _error(value: float | None, factor: float, unit: str) -> str:
    return _UNKNOWN if value is None else f"off by {factor * value:+.2f} {unit}"


def sweep_table(summary: SweepSummary) -> Table:
    """Return the table of a sweep."""
    title = f"{summary.scene}, {summary.trials} trials ({summary.plant}, {summary.perception})"
    s = summary.success
    rate = f"docked: {100 * s.rate:.1f} %, 95 % interval {100 * s.low:.1f} .. {100 * s.high:.1f} %"
    table = Table(title=title, title_justify="left", caption=rate, caption_justify="left")
    table.add_column("")
    for column in ("median", "95 %", "largest"):
        table.add_column(column, justify="right")
    for name, values, unit in (
        ("lateral error at first contact", summary.contact_lateral_mm, "mm"),
        ("yaw error at first contact", summary.contact_yaw_deg, "deg"),
        ("gap between seated faces", summary.seated_axial_mm, "mm"),
        ("steady tracking error", summary.tracking_error_m, "m"),
        ("amplitude at an obstacle", summary.amplitude_m, "m"),
        ("recovery from an obstacle", summary.recovery_s, "s"),
        ("attempts", summary.attempts, ""),
    ):
        if values.p50 is None:
            continue  # no trial of this scene has this figure
        table.add_row(name, *_quantiles(values, unit))
    table.add_section()
    for outcome, count in summary.outcomes.items():
        table.add_row(outcome, str(count), "", "")
    if summary.failures:
        table.add_row(Text("without a result", "red"), str(len(summary.failures)), "", "")
    clearance = summary.min_clearance_m
    table.add_row("smallest clearance", _UNKNOWN if clearance is None else f"{clearance:.3f} m", "", "")
    table.add_row("starts drawn again", str(summary.redraws), "", "")
    table.add_row("taken from the store", str(summary.reused), "", "")
    return table


def _quantiles(values: Quantiles, unit: str) -> list[str]:
    return [
        _UNKNOWN if value is None else f"{value:.{3 if unit == 'm' else 2}f} {unit}".rstrip()
        for value in (values.p50, values.p95, values.max)
    ]


def scenes_table(names: tuple[str, ...]) -> Table:
    """Return the table of shipped scenes with their descriptions."""
    table = Table(title="Shipped scenes", title_justify="left")
    table.add_column("scene", no_wrap=True)
    table.add_column("description")
    for name in names:
        table.add_row(name, load_scene(name).description)
    return table
