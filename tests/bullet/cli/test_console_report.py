"""The tables on the console: belief beside truth, rates with intervals, descriptions of scenes."""

from pathlib import Path

import pytest
from rich.table import Table

from msrr_bullet.cli.console import open_console
from msrr_bullet.cli.console_report import mission_table, scenes_table, step_table, steps_table
from msrr_bullet.cli.sweep_report import sweep_table
from msrr_bullet.sweep.summarise import summarise
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.trial.result import MissionFigures, TrialResult
from msrr_bullet.trial.step_result import AttemptRecord, Contact, PlanarPose, Seating, StepResult
from msrr_scenes import load_scene
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome


def text(table: Table) -> str:
    """Return the table as printed, with single spaces."""
    console = open_console()
    with console.capture() as capture:
        console.print(table)
    return " ".join(capture.get().replace("\u2502", " ").split())


def test_a_terminal_that_says_to_be_of_no_width_gets_its_text(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "0")
    console = open_console()
    with console.capture() as capture:
        console.print("a line")
    assert capture.get() == "a line\n"


@pytest.fixture
def false_dock() -> TrialResult:
    here = PlanarPose(x_m=-0.102, y_m=0.0, yaw_rad=0.0)
    failed = AttemptRecord(ended_s=6.0, phase=Phase.DOCK, reason="stalled", believed=here, true=here)
    port = PlanarPose(x_m=-0.01, y_m=0.0015, yaw_rad=-0.01)
    contact = Contact(time_s=9.0, lateral_m=0.0015, yaw_rad=0.01, port=port)
    step = StepResult(
        index=0,
        unit="a",
        port="front",
        target="b.rear",
        outcome=Outcome.FALSE_DOCK,
        belief="docked",
        belief_reason="the seat switches closed",
        started_s=0.0,
        attempts=(failed, failed.model_copy(update={"contact": contact, "ended_s": 12.5})),
        seating=Seating(axial_gap_m=0.004, lateral_m=0.0, yaw_rad=0.0, seated=False),
    )
    return TrialResult(
        scene="close_range",
        scene_hash="00ff",
        seed=3,
        plant="bullet",
        perception="images",
        outcome=Outcome.FALSE_DOCK,
        reason="the pins are not seated",
        duration_s=12.5,
        steps=(step,),
    )


def test_a_step_shows_belief_beside_truth(false_dock: TrialResult) -> None:
    shown = text(step_table(false_dock, false_dock.steps[0]))
    assert "close_range, seed 3 (bullet, images, perfect): a to b.rear" in shown
    assert "verdict docked false_dock" in shown
    assert "contact: lateral - 1.50 mm" in shown
    assert "contact: yaw - 0.57 deg" in shown
    assert "seated no" in shown
    assert "smallest clearance -" in shown
    assert "attempts, time 2 12.50 s" in shown


def test_what_rounds_to_nothing_has_no_sign(false_dock: TrialResult) -> None:
    """Gaps of seated faces are some micrometres on either side of zero."""
    (step,) = false_dock.steps
    seated = Seating(axial_gap_m=-2e-6, lateral_m=0.0, yaw_rad=0.0, seated=True)
    result = false_dock.model_copy(update={"steps": (step.model_copy(update={"seating": seated}),)})
    assert "gap between the faces 0.00 mm" in text(step_table(result, result.steps[0]))
    summary = summarise(load_scene("close_range"), "code", [result])
    assert "gap between seated faces 0.00 mm 0.00 mm 0.00 mm" in text(sweep_table(summary))
    assert "-0.00" not in summary._repr_html_()


def test_a_trial_has_a_row_for_every_step(false_dock: TrialResult) -> None:
    (failed,) = false_dock.steps
    docked = failed.model_copy(
        update={
            "outcome": Outcome.DOCKED,
            "attempts": failed.attempts[:1],
            "min_clearance_m": 0.25,
        }
    )
    later = failed.model_copy(update={"index": 1, "unit": "c", "target": "a.rear"})
    table = steps_table(false_dock.model_copy(update={"steps": (docked, later)}))
    assert table.row_count == 2
    shown = text(table)
    assert "a to b.rear docked docked - 1 0.250 m 6.00 s" in shown
    assert "c to a.rear docked false_dock 1.50 mm 2 - 12.50 s" in shown


def test_a_narrow_terminal_cuts_nothing_of_the_steps(
    false_dock: TrialResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At the 80 columns of a pipe two of the headings ended in dots, and times were broken."""
    monkeypatch.setenv("COLUMNS", "80")
    (step,) = false_dock.steps
    docked = step.model_copy(update={"outcome": Outcome.DOCKED, "min_clearance_m": 0.25})
    long = docked.model_copy(update={"unit": "second", "target": "first.rear"})
    heading = "step belief truth lateral attempts clearance end"
    short_names, long_names = (
        text(steps_table(false_dock.model_copy(update={"steps": (one,)}))) for one in (docked, long)
    )
    for shown in (short_names, long_names):
        assert heading in " ".join(shown.replace("\u2503", " ").split())
        assert "docked docked 1.50 mm 2 0.250 m 12.50 s" in shown
    assert "a to b.rear docked" in short_names


def test_a_sweep_shows_its_rate_and_what_it_measured(false_dock: TrialResult) -> None:
    failures = [
        TrialFailure(scene="close_range", scene_hash="00ff", seed=4, error="the process of this trial died")
    ]
    summary = summarise(load_scene("close_range"), "code", [false_dock, *failures])
    shown = text(sweep_table(summary))
    assert "docked: 0.0 %, 95 % interval 0.0 .. 65.8 %" in shown
    assert "a to b.rear docked 0 of 1" in shown
    assert "lateral error at first contact 1.50 mm 1.50 mm 1.50 mm" in shown
    assert "false_dock 1" in shown
    assert "without a result 1" in shown
    assert "1 trial without a result counts as not docked" in shown
    assert "recovery" not in shown  # no trial passed an obstacle


def test_a_sweep_shows_what_was_set(false_dock: TrialResult) -> None:
    """The tables of three controllers over the same scene looked the same."""
    summary = summarise(load_scene("close_range"), "code", [false_dock])
    shown = text(sweep_table(summary, ["control.docking=c1", "plan=[{unit: a, to: b.rear}]"]))
    assert "--set control.docking=c1 --set plan=[{unit: a, to: b.rear}]" in shown
    assert "--set" not in text(sweep_table(summary))


def test_a_sweep_shows_the_figures_of_every_step(false_dock: TrialResult) -> None:
    scene = load_scene("three_units")
    shown = text(sweep_table(summarise(scene, "code", [false_dock])))
    first, second = (f"{step.unit} to {step.to}" for step in scene.plan)
    before, _, after = shown.partition(second)
    assert f"{first} docked 0 of 1" in before
    assert "lateral error at first contact 1.50 mm" in before
    assert after.strip().startswith("docked 0 of 0")
    assert "lateral error" not in after


@pytest.fixture
def incomplete(false_dock: TrialResult) -> TrialResult:
    """A mission of which one unit was left over."""
    (step,) = false_dock.steps
    docked = step.model_copy(update={"outcome": Outcome.DOCKED})
    left = docked.model_copy(update={"outcome": Outcome.UNDOCKED, "undocks": True, "belief": "undocked"})
    mission = MissionFigures(
        makespan_s=31.25,
        way_m={"a": 1.25, "b": 0.0},
        parallel_share=0.4,
        messages_sent=200,
        messages_lost=5,
        replans=2,
        done=("a at b.rear",),
        given_up=("c at a.rear",),
        min_clearance_m=0.125,
        nearest_pair="a-post",
    )
    changes = {
        "outcome": Outcome.INCOMPLETE,
        "reason": "given up: c at a.rear",
        "steps": (docked, left),
        "mission": mission,
    }
    return false_dock.model_copy(update=changes)


def test_a_mission_shows_what_came_of_it(incomplete: TrialResult) -> None:
    assert incomplete.mission is not None
    shown = text(mission_table(incomplete, incomplete.mission))
    assert "verdict incomplete" in shown
    assert "reason given up: c at a.rear" in shown
    assert "last lock 31.25 s" in shown
    assert "way driven 1.25 m (a 1.25, b 0.00)" in shown
    assert "two or more under way 40 %" in shown
    assert "messages 200 sent, 5 lost" in shown
    assert "routes planned anew 2" in shown
    assert "smallest clearance 0.125 m (a-post)" in shown
    steps = text(steps_table(incomplete))
    assert "a to b.rear docked docked" in steps
    assert "a from b.rear undocked undocked" in steps


def test_a_sweep_of_missions_counts_what_is_complete(incomplete: TrialResult, line_of_three: Path) -> None:
    complete = incomplete.model_copy(update={"outcome": Outcome.COMPLETE})
    summary = summarise(load_scene(line_of_three), "code", [incomplete, complete])
    shown = text(sweep_table(summary))
    assert "complete: 50.0 %" in shown
    assert "all docking steps docked 2 of 2" in shown  # those that undock are left out
    assert "lateral error at first contact 1.50 mm" in shown
    assert "last lock of complete missions 31.25 s" in shown
    assert "way of all units 1.250 m" in shown
    assert "two or more under way 40.00 %" in shown
    assert "messages lost 2.50 %" in shown
    assert "incomplete 1" in shown
    assert "a to b.rear" not in shown


def test_scenes_have_descriptions() -> None:
    assert load_scene("weak_lock").description.split()[0] in text(scenes_table(("weak_lock",)))


def test_brackets_are_text(false_dock: TrialResult) -> None:
    """Markup swallowed them: names, errors and the help hold brackets of their own."""
    result = false_dock.model_copy(update={"scene": "dock [fast]"})
    assert "dock [fast], seed 3" in text(step_table(result, result.steps[0]))
    assert "dock [fast], seed 3" in text(steps_table(result))
    failures = [TrialFailure(scene="close_range", scene_hash="00ff", seed=4, error="[bold]")]
    scene = load_scene("close_range").model_copy(update={"name": "dock [fast]"})
    assert "dock [fast], 2 trials" in text(sweep_table(summarise(scene, "code", [result, *failures])))
