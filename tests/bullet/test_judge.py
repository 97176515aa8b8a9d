"""The judge's verdict on clearance, against a plain reading of all pairs."""

from __future__ import annotations

import pytest

from msrr_bullet.clearance import ClearanceModel
from msrr_bullet.judge import Judge
from msrr_bullet.stage import Stage
from msrr_bullet.streams import stream
from msrr_bullet.unicycle_plant import UnicyclePlant
from msrr_scenes.messages import Action, Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.placement import Placement
from msrr_scenes.scene import Scene
from msrr_scenes.se2 import SE2

PAIR = frozenset("ab")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "crowd",
            "plant": "unicycle",
            "units": {name: {"number": i} for i, name in enumerate("abc")},
            "obstacles": {"post": {"shape": "cylinder", "radius_m": 0.06}},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


def stage(scene: Scene, model: ClearanceModel, units: dict[str, SE2], post: SE2) -> Stage:
    placement = Placement(units, {"post": post})
    return Stage(scene, 0, UnicyclePlant(scene, placement), None, placement, model, {}, {})


def plain_reading(judge: Judge, at: Stage, docking: bool) -> tuple[Outcome | None, float | None]:
    """Return the verdict and the smallest clearance that counts, from every pair in turn."""
    authorised = docking and judge.port_pose().in_zone
    counted = None
    for clearance in at.clearance.query(at.poses(), at.bonds):
        own = clearance.pair == PAIR
        if clearance.distance <= 0.0 and not (own and authorised):
            return Outcome.COLLISION, counted
        if own and docking:
            continue
        counted = clearance.distance if counted is None else min(counted, clearance.distance)
        if clearance.distance < at.scene.judge.min_clearance_m:
            return Outcome.CLEARANCE_VIOLATED, counted
    return None, counted


def test_the_verdict_is_that_of_a_plain_reading_of_all_pairs(scene: Scene) -> None:
    """600 crowds: before the port or not, docking or not, two of them locked together or not."""
    rng = stream(0, "test_judge/crowds")
    model, step = ClearanceModel(scene), scene.plan[0]
    seat = scene.geometry("b").dock_frame("rear") @ SE2(-scene.geometry("a").control_offset("front"))
    seen = set()
    for i in range(600):
        X_WB = SE2(*rng.uniform([-0.3, -0.3, -3.0], [0.3, 0.3, 3.0]))
        units = {name: SE2(*rng.uniform([-0.6, -0.6, -3.0], [0.6, 0.6, 3.0])) for name in "abc"} | {"b": X_WB}
        if i % 2:
            units["a"] = X_WB @ seat @ SE2(*rng.uniform([-0.04, -0.02, -0.2], [0.0, 0.02, 0.2]))
        at = stage(scene, model, units, SE2(*rng.uniform([-0.6, -0.6, 0.0], [0.6, 0.6, 0.0])))
        if i % 3 == 0:
            at.bonds.add(frozenset("bc"))
        judge, docking = Judge(at, step), bool(i % 5)
        phase = Phase.DOCK if docking else Phase.HAND_OVER
        expected, counted = plain_reading(judge, at, docking)
        verdict, nearest = judge.safety(Action(0, phase, 1))
        assert verdict is expected
        if verdict is None:
            assert judge.min_clearance == counted
            assert nearest == at.clearance.query(at.poses(), at.bonds)[0]
        seen.add((verdict, judge.port_pose().in_zone))
    assert {v for v, _ in seen} == {None, Outcome.COLLISION, Outcome.CLEARANCE_VIOLATED}
    assert (None, True) in seen  # docked, and nothing else near


def test_an_empty_arena_has_no_clearance(scene: Scene) -> None:
    at = stage(scene, ClearanceModel(scene), {name: SE2(x, 0.0) for x, name in enumerate("abc")}, SE2(0, 2))
    everything = {frozenset(p) for p in ("ab", "bc", "ac")} | {frozenset((u, "post")) for u in "abc"}
    at.bonds |= everything
    judge = Judge(at, scene.plan[0])
    assert judge.safety(Action(0, Phase.HAND_OVER, 1)) == (None, None)
    assert judge.min_clearance is None
