"""The judge: clearance against a check of all pairs, seat, arena, and the outcomes at the end."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.simulation.simulation import Simulation
from msrr_bullet.trial.arena_judge import ArenaJudge, Safety
from msrr_bullet.trial.environment import LockedPairs
from msrr_bullet.trial.judge import FALSE_ABORT_TIME_S, Judge
from msrr_bullet.trial.verdict import Verdict
from msrr_scenes.as_built import as_designed
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.messages import Action, FailureReason, Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.placement.placement import Placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import bench

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


@dataclass
class Crowd:
    """A simulation with units at given poses, and what a judge needs."""

    simulation: Simulation
    clearance: ClearanceModel
    locked: LockedPairs = field(default_factory=LockedPairs)

    def judge(self) -> Judge:
        step = self.simulation.scene.plan[0]
        return Judge(self.simulation, self.clearance, self.locked, step)

    def check(self, judge: Judge, phase: Phase, matters: float = math.inf) -> Safety:
        """Return what the judge of the arena finds after a decision in this phase."""
        judge.decide(Action(0, phase, 1))
        judges = ArenaJudge(self.simulation, self.clearance, self.locked)
        return judges.check(self.simulation.poses(), [judge], matters)


def crowd(scene: Scene, model: ClearanceModel, units: dict[str, SE2], post: SE2) -> Crowd:
    placement = Placement(units, {"post": post})
    return Crowd(
        Simulation(scene, as_designed(scene), placement, KinematicPlant(scene, placement), None), model
    )


def outcome_of(found: Safety) -> Outcome | None:
    return None if found.verdict is None else found.verdict.outcome


def check_all_pairs(judge: Judge, crowded: Crowd, docking: bool) -> tuple[Outcome | None, float | None]:
    """Return the outcome and the smallest clearance that counts, from every pair in turn."""
    authorised = docking and judge.port_pose() in judge.zone
    counted = None
    for clearance in crowded.clearance.query(crowded.simulation.poses(), crowded.locked.pairs):
        own = clearance.pair == PAIR
        touches = clearance.distance <= 0.0 and not (own and authorised)
        if own and docking and not touches:
            continue
        counted = clearance.distance if counted is None else min(counted, clearance.distance)
        if touches:
            return Outcome.COLLISION, counted
        if clearance.distance < crowded.simulation.scene.judge.min_clearance_m:
            return Outcome.CLEARANCE_VIOLATED, counted
    return None, counted


def test_the_outcome_is_that_of_a_check_of_all_pairs(scene: Scene) -> None:
    """600 crowds: in front of the port or not, docking or not, with a locked pair or not."""
    rng = stream(0, "test_judge/crowds")
    model = ClearanceModel.from_scene(scene)
    seat = scene.geometry("b").dock_frame("rear") @ SE2(-scene.geometry("a").control_offset("front"))
    cases = set()
    for i in range(600):
        X_WB = SE2(*rng.uniform([-0.3, -0.3, -3.0], [0.3, 0.3, 3.0]))
        units = {name: SE2(*rng.uniform([-0.6, -0.6, -3.0], [0.6, 0.6, 3.0])) for name in "abc"} | {"b": X_WB}
        if i % 2:
            units["a"] = X_WB @ seat @ SE2(*rng.uniform([-0.04, -0.02, -0.2], [0.0, 0.02, 0.2]))
        crowded = crowd(scene, model, units, SE2(*rng.uniform([-0.6, -0.6, 0.0], [0.6, 0.6, 0.0])))
        if i % 3 == 0:
            crowded.locked.pairs.add(frozenset("bc"))
        judge, docking = crowded.judge(), bool(i % 5)
        phase = Phase.DOCK if docking else Phase.HAND_OVER
        expected, counted = check_all_pairs(judge, crowded, docking)
        found = crowded.check(judge, phase)
        assert outcome_of(found) is expected
        assert (found.nearest.distance if found.nearest else None) == counted, (
            "what is reported is what counts"
        )
        # Nobody asks for more than the outcome, or for clearances below a bound.
        for matters in (0.0, 0.15) if i % 4 == 0 else ():
            found_less = crowded.check(judge, phase, matters)
            assert (found_less.verdict, found_less.units) == (found.verdict, found.units)
            if counted is not None and counted < matters:
                assert found_less.nearest == found.nearest
        cases.add((outcome_of(found), judge.port_pose() in judge.zone))
    assert {v for v, _ in cases} == {None, Outcome.COLLISION, Outcome.CLEARANCE_VIOLATED}
    assert (None, True) in cases  # docking, and no other body near


def test_an_obstacle_that_appears_at_a_unit_is_said_to_have_appeared(scene: Scene) -> None:
    post = scene.obstacles["post"].model_copy(update={"appears_at_s": 1.0})
    late = scene.model_copy(update={"obstacles": {"post": post}})
    model = ClearanceModel.from_scene(late)
    units = {name: SE2(x, 0.0) for x, name in enumerate("abc")}
    for place, outcome, said in (
        (SE2(0.0, 0.0), Outcome.COLLISION, "post appeared where a stood, at ("),
        (SE2(-0.175, 0.0), Outcome.CLEARANCE_VIOLATED, "post appeared within 15 mm of a"),
    ):
        crowded = crowd(late, model, units, place)
        judges = ArenaJudge(crowded.simulation, model, crowded.locked)
        assert judges.check(units, []).verdict is None
        found = judges.check(units | {"post": place}, [])
        assert found.verdict is not None
        assert found.verdict.outcome is outcome
        assert found.verdict.reason.startswith(said)
        later = judges.check(units | {"post": place}, [])
        assert later.verdict is not None
        assert later.verdict.reason.startswith(("a touched post", "a came within"))


def test_an_empty_arena_has_no_clearance(scene: Scene) -> None:
    crowded = crowd(
        scene,
        ClearanceModel.from_scene(scene),
        {name: SE2(x, 0.0) for x, name in enumerate("abc")},
        SE2(0, 2),
    )
    everything = {frozenset(p) for p in ("ab", "bc", "ac")} | {frozenset((u, "post")) for u in "abc"}
    crowded.locked.pairs |= everything
    judge = crowded.judge()
    assert crowded.check(judge, Phase.HAND_OVER) == Safety(None, frozenset(), None)


def beside(scene: Scene, x: float, y: float = 0.0, yaw: float = 0.0) -> Crowd:
    """Unit a with its port at (x, y, yaw) in the dock frame of b.rear; c and the post far away."""
    X_WD = SE2(0.1, -0.2, 0.5) @ scene.geometry("b").dock_frame("rear")
    X_WA = X_WD @ SE2(x, y, yaw) @ scene.geometry("a").port("front").inverse()
    units = {"a": X_WA, "b": SE2(0.1, -0.2, 0.5), "c": SE2(1.0, 1.0, 0.0)}
    return crowd(scene, ClearanceModel.from_scene(scene), units, SE2(-1.0, 1.0, 0.0))


def test_the_distance_at_a_collision_is_the_smallest_clearance(scene: Scene) -> None:
    """It kept the value of the instant before, metres away."""
    apart, post = beside(scene, -0.5), SE2(-1.0, 1.0, 0.0)
    before = apart.check(apart.judge(), Phase.HAND_OVER)
    assert before.verdict is None
    units = {name: apart.simulation.poses()[name] for name in "abc"} | {"c": post @ SE2(0.12, 0.0)}
    hit = crowd(scene, apart.clearance, units, post)
    found = hit.check(hit.judge(), Phase.HAND_OVER)
    assert (outcome_of(found), found.units) == (Outcome.COLLISION, {"c", "post"})
    assert before.nearest is not None
    assert found.nearest is not None
    assert found.nearest.distance <= 0.0 < before.nearest.distance


def test_a_pair_that_docks_is_exempt_and_its_neighbours_are_not(scene: Scene) -> None:
    """A seated pair overlaps by its pins, which was shown as a clearance of -18 mm."""
    seated = beside(scene, 0.0)
    overlap = seated.clearance.minimum(seated.simulation.poses())
    assert overlap is not None
    assert (overlap.pair, overlap.distance < -0.01) == (PAIR, True)
    found = seated.check(seated.judge(), Phase.VERIFY)
    assert found.verdict is None
    assert found.nearest == seated.clearance.query(seated.simulation.poses(), {PAIR})[0]
    assert found.nearest.distance > 0.0


def test_pins_may_touch_the_port_however_long_they_are(scene: Scene, tmp_path: Path) -> None:
    """A robot with pins longer than 36 mm collided by the first touch of their tips, round ones here."""
    rod = (
        '<collision><origin xyz="0.02 0 0" rpy="0 1.570796327 0"/><geometry><cylinder radius="0.004" '
        'length="0.04"/></geometry></collision><contact><lateral_friction value="0.35"/></contact></link>'
    )
    head, *pins = scene.geometry("a").urdf.read_text().split('name="pin_')
    pins = [pin.replace("</link>", rod, 1) for pin in pins]
    (tmp_path / "long.urdf").write_text('name="pin_'.join((head, *pins)))
    units = {**scene.units, "a": scene.units["a"].model_copy(update={"urdf": str(tmp_path / "long.urdf")})}
    touching = beside(scene.model_copy(update={"units": units}), -0.039, 0.02)
    assert outcome_of(touching.check(touching.judge(), Phase.HAND_OVER)) is Outcome.COLLISION
    assert touching.check(touching.judge(), Phase.DOCK).verdict is None


def keep_seated(judge: Judge, ticks: int = 200) -> Judge:
    for k in range(ticks):
        judge.tick(k * 4_166_667, 1, lambda: None)
    return judge


@pytest.mark.parametrize(
    ("x", "y", "yaw_deg", "seated"),
    [
        (0.0, 0.0, 0.0, True),
        (-0.001, 0.0025, 1.5, True),
        (-0.001, 0.0035, 0.0, False),
        (-0.001, -0.0035, 0.0, False),
        (-0.001, 0.0, 2.5, False),
        (-0.004, 0.0, 0.0, False),
        (0.5, 0.0, 0.0, False),  # behind the target, and along its axis
        (0.3, 0.0, 0.0, False),
    ],
)
def test_a_unit_is_seated_only_in_the_seat(
    scene: Scene, x: float, y: float, yaw_deg: float, seated: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    crowded = beside(scene, x, y, math.radians(yaw_deg))
    plant = crowded.simulation.plant
    plant.begin_dock(scene.plan[0])
    # An ideal port lets no pins in as far off as those of others may be.
    monkeypatch.setattr(plant, "lock_in_reach", lambda unit: True)
    judge = keep_seated(crowded.judge())
    seating = judge.seating()
    assert (seating is not None and seating.seated) is seated
    # A seated unit that gives up is a false abort.
    verdict = judge.verdict_gave_up(FailureReason.NOT_LOCALISED, ever_detected=False)
    assert (verdict.outcome is Outcome.FALSE_ABORT) is seated


@pytest.mark.parametrize(("x", "abort"), [(-0.0024, True), (-0.0026, False)])
def test_who_gives_up_where_the_lock_cannot_hold_is_right(scene: Scene, x: float, abort: bool) -> None:
    """Pins that jam 2.5 to 3 mm short are seated by the gap, and the lock does not reach them."""
    crowded = beside(scene, x)
    crowded.simulation.plant.begin_dock(scene.plan[0])
    judge = keep_seated(crowded.judge())
    seating = judge.seating()
    assert seating is not None
    assert seating.seated
    verdict = judge.verdict_gave_up(FailureReason.NOT_VERIFIED, ever_detected=True)
    assert (verdict.outcome is Outcome.FALSE_ABORT) is abort


@pytest.mark.parametrize(
    ("x", "y", "watched"),
    [
        (0.0, 0.0, True),
        (-0.05, 0.0, True),  # not in the zone yet, but soon
        (-0.03, 0.06, True),
        (-0.1, 0.0, False),
        (-0.03, 0.2, False),
        (0.5, 0.0, False),  # behind the target
    ],
)
def test_every_tick_is_watched_only_where_the_unit_may_reach_the_zone(
    scene: Scene, x: float, y: float, watched: bool
) -> None:
    crowded = beside(scene, x, y)
    crowded.simulation.plant.begin_dock(scene.plan[0])
    judge = crowded.judge()
    assert judge.watches(1)  # nothing is known yet
    judge.tick(0, 1, lambda: None)
    judge.decide(Action(0, Phase.DOCK, 1))
    assert judge.watches(1) is watched
    assert judge.watches(2)  # a new attempt


def test_a_new_attempt_resets_the_seat(scene: Scene) -> None:
    crowded = beside(scene, 0.0)
    crowded.simulation.plant.begin_dock(scene.plan[0])
    judge = keep_seated(crowded.judge())
    assert judge.verdict_gave_up(FailureReason.STALLED, ever_detected=True).outcome is Outcome.FALSE_ABORT
    judge.tick(10**9, 2, lambda: None)
    assert judge.verdict_gave_up(FailureReason.STALLED, ever_detected=True).outcome is not Outcome.FALSE_ABORT


def test_the_time_in_the_seat_begins_anew_after_a_break(scene: Scene) -> None:
    """Seated, unseated, seated again: only the time since the break counts, however long it was before."""
    seat, off = beside(scene, 0.0), beside(scene, -0.01)
    for each in (seat, off):
        each.simulation.plant.begin_dock(scene.plan[0])
    judge = seat.judge()
    share_ns = round(0.8e9 * FALSE_ABORT_TIME_S)
    # Two stays of 0.8 of the time, with a break of one tick: more than enough together, neither by itself.
    for start_ns in (0, share_ns + 2):
        for at_ns in (start_ns, start_ns + share_ns):
            judge.tick(at_ns, 1, lambda: None)
        judge._plant = off.simulation.plant
        judge.tick(start_ns + share_ns + 1, 1, lambda: None)
        judge._plant = seat.simulation.plant
        verdict = judge.verdict_gave_up(FailureReason.STALLED, ever_detected=True)
        assert verdict.outcome is not Outcome.FALSE_ABORT
    third_ns = 2 * share_ns + 4
    for at_ns in (third_ns, third_ns + round(1.01e9 * FALSE_ABORT_TIME_S)):
        judge.tick(at_ns, 1, lambda: None)
    assert judge.verdict_gave_up(FailureReason.STALLED, ever_detected=True).outcome is Outcome.FALSE_ABORT


@pytest.mark.parametrize("phase", [Phase.FAILED, Phase.HAND_OVER, Phase.ASSEMBLE])
def test_a_pair_that_tried_to_dock_may_stay_close_until_it_has_parted(scene: Scene, phase: Phase) -> None:
    near, far = beside(scene, -0.03), beside(scene, -0.10)
    assert near.clearance.minimum(near.simulation.poses()).distance < scene.judge.min_clearance_m
    assert outcome_of(near.check(near.judge(), phase)) is Outcome.CLEARANCE_VIOLATED, (
        "the pair has not docked"
    )
    judge = near.judge()
    for step in (Phase.DOCK, Phase.RETREAT, phase, phase):
        assert near.check(judge, step).verdict is None
    judge._plant = far.simulation.plant
    assert far.check(judge, phase).verdict is None
    judge._plant = near.simulation.plant
    assert outcome_of(near.check(judge, phase)) is Outcome.CLEARANCE_VIOLATED, "the pair has parted"


def test_a_unit_that_has_ended_its_step_in_the_port_may_not_touch_beside_it(scene: Scene) -> None:
    """The judge of a step that has ended went by where the unit was at its last decision."""
    judge = beside(scene, -0.002).judge()
    judge.decide(Action(0, Phase.RETREAT, 1))
    assert judge.may_be_near()
    x = judge.X_DU().x
    X_WU = judge.X_WD() @ SE2(x, 0.0, math.radians(60.0))
    judge._plant._poses["a"] = X_WU
    assert not judge.may_be_near()


def test_a_unit_beyond_the_edge_has_left_the_arena(scene: Scene) -> None:
    arena = scene.arena
    model = ClearanceModel.from_scene(scene)
    for x, y, left in (
        (arena.x_m[1] - 0.01, 0.0, False),
        (arena.x_m[1] + 0.01, 0.0, True),
        (arena.x_m[0] - 0.01, 0.0, True),
        (0.0, arena.y_m[1] - 0.01, False),
        (0.0, arena.y_m[1] + 0.01, True),
        (0.0, arena.y_m[0] - 0.01, True),
    ):
        units = {"a": SE2(x, y, 0.3), "b": SE2(0.0, 1.0, 0.0), "c": SE2(0.0, -1.0, 0.0)}
        crowded = crowd(scene, model, units, SE2(1.0, 1.0, 0.0))
        found = crowded.check(crowded.judge(), Phase.DOCK)
        assert (outcome_of(found) is Outcome.LEFT_ARENA) is left, (x, y)


def test_docked_needs_the_seat_and_the_lock(scene: Scene) -> None:
    seated, outside = beside(scene, 0.0), beside(scene, -0.3)
    unseated = beside(scene, -0.004, 0.001)
    assert seated.judge().verdict_docked(engaged=True) == Verdict(Outcome.DOCKED)
    for crowded, engaged, reason in (
        (seated, False, "the lock holds nothing"),
        (outside, True, "the unit is not at the port"),
        (unseated, True, "the pins are not seated: 4.0 mm before the end, 1.0 mm and 0.0 deg off"),
    ):
        assert crowded.judge().verdict_docked(engaged) == Verdict(Outcome.FALSE_DOCK, reason)


@pytest.mark.parametrize(
    ("y", "drive_s", "outcome"),
    [(0.008, 0.05, Outcome.BLOCKED), (0.014, 0.7, Outcome.JAMMED), (0.008, 0.7, Outcome.NOT_SEATED)],
)
def test_a_unit_whose_pins_have_touched_the_port_was_not_blocked_on_its_way(
    y: float, drive_s: float, outcome: Outcome
) -> None:
    """Whatever the robot says of its way, how far the pins went in tells what came of the attempt."""
    with bench("bullet", SE2(-0.03, y, 0.0)) as b:
        judge = _judged(b, drive_s)
        assert (judge.contact_in(1) is None) is (outcome is Outcome.BLOCKED)
        assert judge.verdict_gave_up(FailureReason.BLOCKED, ever_detected=True).outcome is outcome


def test_pins_with_more_play_are_in_line_farther_off(tmp_path: Path) -> None:
    """Pins of 4 mm in throats of 16 mm, 5 mm beside the axis, stopped by a plug: nothing has jammed them."""
    thin = find_urdf("unit.urdf").read_text()
    for thick, slim in (
        ("0.019 0.013 ", "0.019 0.004 "),  # the pins
        ("0.008 0.01 ", "0.008 0.004 "),  # their tips
        ("0.004345506", "0.0003"),  # and the tapers between
    ):
        assert thick in thin
        thin = thin.replace(thick, slim)
    (tmp_path / "thin.urdf").write_text(thin)
    units = {"a": {"number": 1, "urdf": str(tmp_path / "thin.urdf")}, "b": {"number": 2}}
    with bench("bullet", SE2(-0.03, 0.005, 0.0), units=units) as b:
        b.plant.set_plug("b", "rear", True)
        judge = _judged(b, 0.7)
        assert judge.contact_in(1) is not None
        b.plant.set_plug("b", "rear", False)
        assert judge.verdict_gave_up(FailureReason.STALLED, ever_detected=True).outcome is Outcome.NOT_SEATED


@pytest.mark.parametrize(("plugged", "outcome"), [(True, Outcome.NOT_SEATED), (False, Outcome.JAMMED)])
def test_pins_in_the_holes_that_a_plug_has_stopped_have_not_jammed(plugged: bool, outcome: Outcome) -> None:
    """A unit that comes in beside the axis, as later attempts do, is as far off as the funnels let it."""
    with bench("bullet", SE2(-0.03, 0.0065, 0.0)) as b:
        b.plant.set_plug("b", "rear", True)
        judge = _judged(b, 0.7)
        b.plant.set_plug("b", "rear", plugged)
        assert judge.verdict_gave_up(FailureReason.STALLED, ever_detected=True).outcome is outcome


def _judged(b: Any, drive_s: float) -> Judge:
    """Drive ``a`` straight ahead, and return the judge that observed every tick."""
    simulation = Simulation(b.scene, as_designed(b.scene), Placement({}, {}), b.plant, b.plant.world)
    judge = Judge(simulation, ClearanceModel.from_scene(b.scene), LockedPairs(), b.scene.plan[0])
    for _ in range(round(drive_s / b.dt)):
        b.drive(0.05, b.dt)
        judge.tick(b.plant.now_ns(), 1, lambda: None)
    return judge
