"""Missions in which something fails: a drive, a way, a port, the radio. They end as they should."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_bullet.log import Event, MemoryRecorder
from msrr_bullet.run import run_trial
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_scenes.loading.load import load_scene
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

Load = Callable[..., Scene]

BAD = {Outcome.COLLISION, Outcome.CLEARANCE_VIOLATED, Outcome.FALSE_DOCK, Outcome.FALSE_ABORT}

POST = "shape: cylinder, radius_m: 0.05, height_m: 0.1, tag_id: 500, pose: {x_m: 0.17}"

#: Two of three units become a pair. The one that is to drive seizes, so the third one takes its place.
PAIR = """
description: One of three units seizes on its way to a pair.
time_limit_s: 120
arena: {x_m: [-1.9, 1.9], y_m: [-1.4, 1.4]}
units:
  a: {number: 0, pose: {x_m: 0.6, y_m: 0.0}}
  b: {number: 1, pose: {x_m: -1.0, y_m: 0.5, yaw_deg: -20}}
  c: {number: 2, pose: {x_m: -1.2, y_m: -0.9, yaw_deg: 180}}
cameras: {overhead: {height_m: 4.0}}
faults: [{kind: unit_seized, unit: b, from_s: 3.0}]
shape: {line: 2}
"""


def untouched(result: TrialResult) -> bool:
    assert result.mission is not None
    return not BAD & {result.outcome, *(step.outcome for step in result.steps)}


def reason(result: TrialResult) -> str:
    assert result.mission is not None
    return result.reason


def test_another_unit_takes_the_place_of_one_that_seizes(tmp_path: Path) -> None:
    path = tmp_path / "pair.yaml"
    path.write_text(PAIR)
    result = run_trial(load_scene(path, {"perception": "parametric"}), 1)
    assert result.outcome is Outcome.COMPLETE, reason(result)
    assert untouched(result)
    steps = [(step.unit, step.outcome, step.belief) for step in result.steps]
    assert steps == [("b", Outcome.GAVE_UP, "gave_up"), ("c", Outcome.DOCKED, "docked")]
    assert "the drive has seized" in result.steps[0].belief_reason
    assert result.steps[0].attempts[-1].ended_s < 9.5  # about five seconds after the fault


def test_a_unit_that_seizes_in_the_lane_has_the_shape_built_elsewhere(tmp_path: Path) -> None:
    """In its dock leg the phase machine notices it: no attempt gets any nearer to the port."""
    (tmp_path / "pair.yaml").write_text(PAIR)
    blind = {"plant": "unicycle", "perception": "parametric", "faults.0.from_s": "12"}
    brief = {"docking.stall_time_s": "0.8", "docking.retreat_m": "0.15"}
    result = run_trial(load_scene(tmp_path / "pair.yaml", blind | brief), 1)
    assert result.outcome is Outcome.COMPLETE, reason(result)
    assert untouched(result)
    failed, docked = result.steps
    assert (failed.unit, failed.outcome, docked.outcome) == ("b", Outcome.GAVE_UP, Outcome.DOCKED)
    assert {docked.unit, docked.target.partition(".")[0]} == {"a", "c"}
    assert "no progress" in failed.belief_reason


@pytest.mark.parametrize("appears_at_s", [pytest.param(3.0, marks=pytest.mark.nightly), 9.5])
def test_a_shape_is_built_elsewhere_when_an_obstacle_comes_into_the_lane(
    appears_at_s: float, tmp_path: Path
) -> None:
    """The unit is on its way to the lane, or in it, and is recalled; it neither tries again nor is lost."""
    text = "".join(line for line in PAIR.splitlines(keepends=True) if not line.startswith(("  c:", "faults")))
    (tmp_path / "pair.yaml").write_text(
        text + f"obstacles: {{post: {{{POST}, appears_at_s: {appears_at_s}}}}}\n"
    )
    blind = {"plant": "unicycle", "perception": "parametric"}
    result = run_trial(load_scene(tmp_path / "pair.yaml", blind), 1)
    assert result.outcome is Outcome.COMPLETE, reason(result)
    assert untouched(result)
    assert [step.outcome for step in result.steps] == [Outcome.ABORTED, Outcome.DOCKED]
    assert len(result.steps[0].attempts) <= 2
    assert result.steps[0].ended_s < appears_at_s + 6.0


@pytest.mark.parametrize("led", [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_a_lane_that_is_closed_has_the_target_go_elsewhere_if_somebody_leads_it(
    led: bool, tmp_path: Path
) -> None:
    """A plan leaves no other port, and a unit on its own can only say why it cannot dock."""
    text = "".join(
        line for line in PAIR.splitlines(keepends=True) if not line.startswith(("  c:", "faults", "shape"))
    )
    text += f"obstacles: {{post: {{{POST}, appears_at_s: 9.5}}}}\nplan: [{{unit: b, to: a.rear}}]\n"
    (tmp_path / "pair.yaml").write_text(text + "radio: {}\n" * led)
    blind = {"plant": "unicycle", "perception": "parametric"}
    result = run_trial(load_scene(tmp_path / "pair.yaml", blind), 1)
    assert not BAD & {step.outcome for step in result.steps}
    outcomes = [step.outcome for step in result.steps]
    if led:
        assert (result.outcome, outcomes) == (Outcome.COMPLETE, [Outcome.ABORTED, Outcome.DOCKED])
        assert untouched(result)
    else:
        assert (result.outcome, outcomes) == (Outcome.BLOCKED, [Outcome.BLOCKED])
        assert "post stands in the lane to the port" in result.steps[0].belief_reason
    assert len(result.steps[0].attempts) == 2


def test_without_a_spare_the_mission_names_the_unit(tmp_path: Path) -> None:
    text = "".join(line for line in PAIR.splitlines(keepends=True) if not line.startswith("  c:"))
    (tmp_path / "pair.yaml").write_text(text)
    blind = {"plant": "unicycle", "perception": "parametric"}
    result = run_trial(load_scene(tmp_path / "pair.yaml", blind), 1)
    assert result.outcome is Outcome.INCOMPLETE
    assert untouched(result)
    assert "b: the drive has seized" in reason(result)


def test_two_units_pass_a_lane_for_one(shipped: Load) -> None:
    result = run_trial(shipped("corridor", blind=True), 0)
    assert result.outcome is Outcome.COMPLETE, reason(result)
    assert untouched(result)
    assert result.mission is not None
    assert result.mission.replans == 0  # the later one waited; nobody planned anew


@pytest.mark.nightly
def test_of_two_that_want_one_port_one_is_told_why_it_cannot(shipped: Load) -> None:
    result = run_trial(shipped("one_port", blind=True), 0)
    assert result.outcome is Outcome.INCOMPLETE
    assert untouched(result)
    assert [step.outcome for step in result.steps] == [Outcome.DOCKED]
    assert "c cannot dock: b.rear is taken by a" in reason(result)


@pytest.mark.nightly
@pytest.mark.timeout(3000)
@pytest.mark.parametrize(
    ("name", "outcome"),
    [("spare", Outcome.COMPLETE), ("no_spare", Outcome.INCOMPLETE), ("deaf", Outcome.COMPLETE)],
)
def test_large_missions_survive_failures(name: str, outcome: Outcome, shipped: Load) -> None:
    for seed in range(100, 103):
        result = run_trial(shipped(name, blind=True), seed)
        assert result.outcome is outcome, reason(result)
        assert untouched(result)
        assert result.mission is not None
        if name == "deaf":
            assert result.mission.messages_lost > 0.2 * result.mission.messages_sent
        if name == "no_spare":
            assert len(result.mission.done) == 5
            assert "f: the drive has seized" in reason(result)


@pytest.mark.parametrize(
    ("wheel", "seed", "grade"),
    [
        ("left", 1, "perfect"),
        pytest.param("left", 1, "careful", marks=pytest.mark.nightly),
        pytest.param("right", 2, "careful", marks=pytest.mark.nightly),
    ],
)
def test_a_unit_docks_by_what_it_sees_where_an_encoder_is_stuck(
    wheel: str, seed: int, grade: str, shipped: Load
) -> None:
    """It fails two seconds before the contact; by the wheels the unit turns on the spot from then on.

    An event says so where more than a tenth of the exposures do not agree with the wheels.
    """
    faults, recorder = f"[{{kind: encoder_stuck, unit: a, wheel: {wheel}, from_s: 4}}]", MemoryRecorder()
    scene = shipped("close_range", {"faults": faults, "as_built": grade})
    result = Trial(scene, seed, recorder=recorder).run()
    assert result.outcome is Outcome.DOCKED, result.reason
    seen = result.decisive_step.onboard_exposures
    assert seen is not None
    assert seen.without_wheels > 10
    told = [event.text for *_, event in recorder.messages if isinstance(event, Event)]
    wrong = seen.without_wheels + seen.rejected
    says_so = any(text.startswith(f"{wrong} of {seen.total} exposures of the onboard") for text in told)
    assert says_so is (wrong > 0.1 * seen.total)


@pytest.mark.parametrize(("scene", "from_s"), [("two_units", 5), ("close_range", 3)])
def test_a_unit_on_its_own_knows_that_its_drive_has_seized(
    shipped: Callable[..., Scene], scene: str, from_s: float
) -> None:
    """It looked for one path after the other for a minute, and said that it was blocked.

    In front of the port it made all of its attempts from where it stood.
    """
    fault = {"faults": f"[{{kind: unit_seized, unit: a, from_s: {from_s}}}]"}
    result = run_trial(shipped(scene, fault, blind=True), 0)
    (step,) = result.steps
    assert (step.outcome, step.belief_reason[:22]) == (Outcome.GAVE_UP, "the drive has seized: ")
    assert step.ended_s < 12.0
