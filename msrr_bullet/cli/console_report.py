"""The tables that the command line prints: a trial with steps and mission, a sweep, the shipped scenes."""

from __future__ import annotations

import math

from rich.table import Table
from rich.text import Text

from msrr_bullet.trial.result import MissionFigures, TrialResult
from msrr_bullet.trial.step_result import PlanarPose, StepResult
from msrr_scenes.loading.load import find_scene, read_document
from msrr_scenes.messages import ExposureCounts

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


def _verdict(of: StepResult | TrialResult) -> Text:
    succeeded = of.succeeded if isinstance(of, StepResult) else of.docked
    return Text(of.outcome.value, "green" if succeeded else "red")


def steps_table(result: TrialResult) -> Table:
    """Return the table of a trial with a row for every step that began."""
    table = Table(title=result.title, title_justify="left")
    for column in ("step", "belief", "truth"):  # the widest column breaks first where a terminal is narrow
        table.add_column(column, overflow="fold")
    for column in ("lateral", "attempts", "clearance", "end"):
        table.add_column(column, justify="right", overflow="fold")
    for step in result.steps:
        contact = step.contact
        table.add_row(
            step.task,
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
    table = Table(title=f"{result.title}: mission", title_justify="left", show_header=False)
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
    table = Table(title=f"{result.title}: {step.task}", title_justify="left")
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
            _error(error.y_m if error else None, 1000.0, "mm", "axle "),
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


def _error(value: float | None, factor: float, unit: str, of: str = "") -> str:
    return _UNKNOWN if value is None else f"{of}off by {factor * value:+z.2f} {unit}"


def scenes_table(names: tuple[str, ...]) -> Table:
    """Return the table of shipped scenes with their descriptions."""
    table = Table(title="Shipped scenes", title_justify="left")
    table.add_column("scene", no_wrap=True)
    table.add_column("description")
    for name in names:
        table.add_row(name, read_document(find_scene(name)).data["description"])
    return table
