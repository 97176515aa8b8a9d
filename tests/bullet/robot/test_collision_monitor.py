"""The collision monitor: commands that lead to a collision stop short, all others pass."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.log import LOG_NAME, LogHeader, read_log
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_bullet.sensors.command_link import CommandLink
from msrr_bullet.sensors.schedule import Periodic
from msrr_bullet.trial.trial import Trial
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    CollisionMonitorState,
    GlobalPose,
    MonitorState,
    ObstacleEstimate,
    Phase,
    Twist,
)
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.control import GuardSpec
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none

SIGMA_M = 0.0003
TIGHT = np.diag([SIGMA_M**2, SIGMA_M**2, 1e-7])
FAR = SE2(1.8, 1.3, 0.5)
POST = {"shape": "cylinder", "radius_m": 0.06, "height_m": 0.2, "tag_id": 500}
BOX = {"shape": "box", "length_m": 0.3, "width_m": 0.1, "height_m": 0.2, "tag_id": 500}
#: Moves the true pose slightly, because FCL fails where a face is straight in front of a disc.
OFFSET = SE2(2e-4, 3e-4, 2e-4)


def arena(obstacle: Mapping[str, Any] = POST, **changes: Any) -> Scene:
    return Scene.model_validate(
        {
            "name": "arena",
            "plant": "unicycle",
            "units": {"a": {"number": 0}, "b": {"number": 1}},
            "obstacles": {"thing": obstacle},
            "plan": [{"unit": "a", "to": "b.rear"}],
            **changes,
        }
    )


def known(
    now_ns: int, X_WA: SE2, X_WO: SE2 | None, X_WB: SE2 = FAR, covariance: np.ndarray = TIGHT
) -> ArenaEstimate:
    obstacles = () if X_WO is None else (ObstacleEstimate("thing", now_ns, X_WO, covariance, 0.06),)
    own, target = (GlobalPose(name, now_ns, X, covariance) for name, X in (("a", X_WA), ("b", X_WB)))
    return ArenaEstimate(now_ns, own, target, (), obstacles, now_ns)


Law = Callable[[SE2], Twist]


def drive(
    scene: Scene, X_WA: SE2, X_WO: SE2, law: Law, time_s: float, X_WB: SE2 = FAR
) -> tuple[float, list[MonitorState], SE2]:
    """Return the smallest true clearance, the state of the monitor at each command, and the last pose.

    ``law`` gets the pose of the obstacle in the frame of the unit.
    """
    plant = KinematicPlant(scene, Placement({"a": X_WA, "b": X_WB}, {"thing": X_WO}))
    monitor, model = CollisionMonitor(scene, "a", scene.docks[0]), ClearanceModel.from_scene(scene)
    every = round(scene.physics_hz / 48.0)
    nearest, states = math.inf, []
    while plant.now_ns() < time_s * 1e9:
        X = plant.pose("a")
        if plant.tick % every == 0:
            now_ns = plant.now_ns()
            decision = monitor.limit(law(X.inverse() @ X_WO), known(now_ns, X, X_WO, X_WB), now_ns)
            states.append(decision.state)
            plant.command("a", decision.twist)
            clearance = not_none(model.minimum({"a": X @ OFFSET, "b": X_WB, "thing": X_WO}))
            nearest = min(nearest, clearance.distance)
        plant.step()
    return nearest, states, plant.pose("a")


def pursuit(v: float) -> Law:
    """Drive at ``v`` and steer towards the obstacle."""

    def law(X_UO: SE2) -> Twist:
        bearing = math.atan2(X_UO.y, X_UO.x) if v > 0.0 else math.atan2(-X_UO.y, -X_UO.x)
        return Twist(v, max(-1.5, min(1.5, 4.0 * bearing)))

    return law


@pytest.mark.parametrize("seed", range(20))
def test_a_unit_driven_at_an_obstacle_stops_in_front_of_it(seed: int) -> None:
    """Forwards and backwards, posts and boxes, straight and steered, both settings of the drive."""
    rng = np.random.default_rng(seed)
    scene = arena((POST, BOX)[seed % 2], limits={"setting": ("normal", "tight")[seed // 2 % 2]})
    v = -0.4 if seed % 5 == 0 else 0.4
    X_WO = SE2(0.2, -0.1, float(rng.uniform(-3.0, 3.0)))
    course, way, side = float(rng.uniform(-3.0, 3.0)), rng.uniform(0.5, 0.9), rng.uniform(-0.1, 0.1)
    heading = course if v > 0.0 else course + math.pi
    X_WA = SE2(X_WO.x, X_WO.y, course) @ SE2(-way, side, 0.0)
    law: Law = pursuit(v) if seed % 3 else lambda _: Twist(v)
    nearest, states, _ = drive(scene, SE2(X_WA.x, X_WA.y, heading), X_WO, law, 4.5)
    spec = scene.control.guard
    assert nearest >= spec.stop_m
    assert nearest < spec.slow_m + 0.01  # it came close, so that the monitor stopped it
    assert states[0] is MonitorState.FREE
    assert states[-1] is not MonitorState.FREE


@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 8), marks=pytest.mark.nightly)])
@pytest.mark.parametrize(("rate_hz", "latency_ms"), [(100.0, 250.0), (10.0, 500.0)])
def test_a_unit_on_a_slow_link_stops_as_far_away(rate_hz: float, latency_ms: float, seeds: range) -> None:
    """Units that drive at one body or the other, or anywhere, keep ``stop_m`` to half a millimetre.

    They came up to 5 mm nearer: what a command led to was computed too coarsely, and a share of a command
    passed that turned the unit less and led nearer than the whole.
    """
    changes = {"link": {"latency_ms": latency_ms}, "control": {"rate_hz": rate_hz}}
    for seed in seeds:
        rng = np.random.default_rng(seed)
        scene = arena(
            (POST, BOX)[seed % 2], limits={"setting": ("normal", "tight")[seed // 2 % 2]}, **changes
        )
        X_WO, (a, b) = SE2(0.2, -0.1, float(rng.uniform(-3.0, 3.0))), rng.uniform([-3.0, 1.2], [3.0, 2.2])
        X_WA, X_WB = (
            SE2(X_WO.x + r * math.cos(at), X_WO.y + r * math.sin(at), float(rng.uniform(-3.0, 3.0)))
            for r, at in ((0.7, a), (0.65, a + b))
        )
        plant = KinematicPlant(scene, Placement({"a": X_WA, "b": X_WB}, {"thing": X_WO}))
        monitor, model = CollisionMonitor(scene, "a", scene.docks[0]), ClearanceModel.from_scene(scene)
        link, control, changes_ns = CommandLink(scene.link, rng), Periodic(rate_hz), 0
        nearest, law, towards = math.inf, pursuit(0.4), X_WO
        while (now_ns := plant.now_ns()) < 8e9:
            X = plant.pose("a")
            if control.due(now_ns):
                if now_ns >= changes_ns:
                    changes_ns = now_ns + round(1e9 * rng.uniform(0.05, 1.5))
                    anywhere = Twist(*rng.uniform([-0.4, -1.5], [0.4, 1.5]))
                    kind = int(rng.integers(3))
                    law = pursuit(0.4) if kind else lambda _, twist=anywhere: twist
                    towards = X_WB if kind == 1 else X_WO
                command = law(X.inverse() @ towards)
                twist = monitor.limit(command, known(now_ns, X, X_WO, X_WB), now_ns).twist
                link.send(Action(now_ns, Phase.ASSEMBLE, 1, twist))
            if (arrived := link.arrived(now_ns)) is not None:
                plant.command("a", arrived.twist)
            if plant.tick % 4 == 0:
                clearance = not_none(model.minimum({"a": X @ OFFSET, "b": X_WB, "thing": X_WO}))
                nearest = min(nearest, clearance.distance)
            plant.step()
        assert nearest > scene.control.guard.stop_m - 5e-4


def test_without_the_monitor_the_unit_collides() -> None:
    scene = arena(control={"guard": {"enabled": False}})
    nearest, states, _ = drive(scene, SE2(-0.7, 0.0, 0.0), SE2(), pursuit(0.4), 4.0)
    assert nearest < 0.0
    assert set(states) == {MonitorState.FREE}


def test_passing_at_the_distance_of_the_path_is_not_slowed() -> None:
    """Around a post at cruise speed, with 6.5 cm between the unit's side and the post."""
    scene = arena()
    radius = 0.06 + 0.10 + 0.065

    def orbit(X_UO: SE2) -> Twist:
        turn = math.atan2(X_UO.y, X_UO.x) - 0.5 * math.pi
        return Twist(0.22, 0.22 / radius + 3.0 * turn + 4.0 * (math.hypot(X_UO.x, X_UO.y) - radius))

    nearest, states, X_end = drive(scene, SE2(0.0, -radius - 0.1, 0.0), SE2(), orbit, 10.0)
    assert set(states) == {MonitorState.FREE}
    assert math.hypot(X_end.x, X_end.y) == pytest.approx(radius, abs=0.005)
    assert nearest == pytest.approx(0.065, abs=0.01)


def test_a_command_that_leads_away_passes_however_near_the_unit_is() -> None:
    scene = arena()
    for gap in (0.001, 0.01, 0.03):
        X_WA = SE2(-0.06 - 0.118 - gap, 0.0, 0.0)
        monitor = CollisionMonitor(scene, "a", scene.docks[0])
        back = monitor.limit(Twist(-0.3, 0.2), known(0, X_WA, SE2()), 0)
        assert (back.state, back.twist) == (MonitorState.FREE, Twist(-0.3, 0.2))
        assert back.clearance is not None
        # The pins are beside the middle, so that the rim of the post is farther from them than the face.
        assert gap - 1e-6 <= back.clearance.distance < gap + 0.03
        assert monitor.limit(Twist(0.3), known(0, X_WA, SE2()), 0).state is not MonitorState.FREE


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_unit_whose_rear_would_swing_towards_a_body_beside_it_creeps_straight_on(side: float) -> None:
    """In front of a port, beside a unit that waited there, three attempts to dock were held."""
    scene = arena()
    X_WO = SE2(-0.08, side * (0.10 + 0.06 + 0.058))
    command = Twist(0.1, -0.1 * side)
    rough = known(0, SE2(), X_WO, covariance=np.diag([0.013**2, 0.013**2, 1e-6]))
    decision = CollisionMonitor(scene, "a", scene.docks[0]).limit(command, rough, 0)
    assert decision.ahead < scene.control.guard.stop_m
    assert (decision.state, decision.twist) == (MonitorState.SLOW, Twist(0.025, 0.0))


@pytest.mark.parametrize("count", [500, pytest.param(2000, marks=pytest.mark.nightly)])
def test_the_monitor_never_adds_to_a_command(count: int) -> None:
    """Random commands near bodies: a share of each command passes, or of its turn or its way alone."""
    scene = arena()
    rng = np.random.default_rng(0)
    states = set()
    for i in range(count):
        command = Twist(*rng.uniform([-0.4, -1.5], [0.4, 1.5]))
        X_WA = SE2(*rng.uniform([-0.35, -0.35, -math.pi], [0.35, 0.35, math.pi]))
        decision = CollisionMonitor(scene, "a", scene.docks[0]).limit(command, known(i, X_WA, SE2()), i)
        states.add(decision.state)
        v, w = decision.twist.v / command.v, decision.twist.w / command.w
        assert 0.0 <= v <= 1.0
        assert 0.0 <= w <= 1.0
        assert v == pytest.approx(w) or v == 0.0 or (w == 0.0 and v == 0.25)
        assert (decision.state is MonitorState.FREE) == (decision.twist == command)
        assert (decision.state is MonitorState.STOP) == (decision.twist == Twist())
    assert states == set(MonitorState)


def test_a_command_to_stand_still_passes_unchanged_however_near_the_unit_comes_as_it_brakes() -> None:
    """It counted as one that the monitor had slowed or stopped, as if a body held the unit."""
    scene = arena()
    monitor = CollisionMonitor(scene, "a", scene.docks[0])
    for i in range(60):
        monitor.limit(Twist(0.2), known(i * 20_000_000, SE2(), SE2(2.0, 0.0)), i * 20_000_000)
    for gap_m in (0.05, 0.03, 0.02):
        at = known(1_200_000_000, SE2(), SE2(0.12 + 0.06 + gap_m, 0.0))
        decision = monitor.limit(Twist(), at, 1_200_000_000)
        assert (decision.state, decision.twist) == (MonitorState.FREE, Twist())
        assert decision.clearance is not None
        assert decision.ahead < decision.clearance.distance - 0.001, "it still moves towards the body"


def test_the_target_may_be_touched_while_docking_and_nothing_else() -> None:
    scene = arena()
    at_port = SE2(-0.1 - 0.118 - 0.01, 0.0, 0.0)
    push = Twist(0.1)
    for docking, state in ((False, MonitorState.STOP), (True, MonitorState.FREE)):
        monitor = CollisionMonitor(scene, "a", scene.docks[0])
        assert monitor.limit(push, known(0, at_port, SE2(0.0, 2.0), SE2()), 0, docking).state is state
    monitor = CollisionMonitor(scene, "a", scene.docks[0])
    ahead = SE2(at_port.x + 0.12 + 0.06 + 0.01, 0.0)
    assert monitor.limit(push, known(0, at_port, ahead), 0, docking=True).state is MonitorState.STOP


def test_the_uncertainty_is_subtracted_for_a_command_that_leads_away_as_well() -> None:
    scene, X_WA = arena(), SE2(-0.06 - 0.118 - 0.05, 0.0, 0.0)
    ahead = []
    for sigma_m in (0.0, 0.02):
        covariance = np.diag([sigma_m**2, sigma_m**2, 0.0])
        monitor = CollisionMonitor(scene, "a", scene.docks[0])
        decision = monitor.limit(Twist(-0.15), known(0, X_WA, SE2(), covariance=covariance), 0)
        assert decision.state is MonitorState.FREE
        ahead.append(decision.ahead)
    assert ahead[0] == pytest.approx(0.05, abs=0.01)
    assert ahead[0] - ahead[1] == pytest.approx(2.0 * math.hypot(0.02, 0.02))


def test_a_share_of_a_command_passes_that_falls_to_a_quarter_where_it_leads_too_near() -> None:
    """In proportion to the clearance ahead, from all of it on; below that less than a quarter, or nothing."""
    scene, shares = arena(), dict[float, float]()
    spec = scene.control.guard
    for gap in np.arange(0.0, 0.12, 0.002).tolist():
        X_WA, monitor = SE2(-0.06 - 0.118 - gap, 0.0, 0.0), CollisionMonitor(scene, "a", scene.docks[0])
        decision = monitor.limit(Twist(0.2), known(0, X_WA, SE2()), 0)
        shares[decision.ahead] = decision.twist.v / 0.2
    between = [(a, share) for a, share in shares.items() if spec.stop_m <= a < spec.slow_m]
    assert len(between) > 5
    assert all(share == 1.0 for a, share in shares.items() if a >= spec.slow_m)
    assert all(share < 0.25 for a, share in shares.items() if a < spec.stop_m)
    assert min(shares.values()) == 0.0
    slope, _ = line = np.polyfit(*np.transpose(between), 1)
    assert slope > 0.0
    assert np.polyval(line, [spec.stop_m, spec.slow_m]) == pytest.approx([0.25, 1.0], abs=1e-6)


def test_without_an_estimate_every_command_passes() -> None:
    scene = arena()
    monitor = CollisionMonitor(scene, "a", scene.docks[0])
    decision = monitor.limit(Twist(0.4, 1.0), None, 0)
    assert (decision.twist, decision.state, decision.clearance) == (Twist(0.4, 1.0), MonitorState.FREE, None)
    assert (
        monitor.limit(Twist(0.4), known(1, SE2(), None, X_WB=SE2(0.1, 0.0)), 1, docking=True).clearance
        is None
    )


def test_an_estimate_of_the_past_is_extrapolated() -> None:
    """Without delay compensation the pose is 0.15 s old: at 0.4 m/s the unit is 6 cm farther."""
    scene = arena()
    monitor = CollisionMonitor(scene, "a", scene.docks[0])
    X_WO = SE2(2.0, 0.0)
    for i in range(100):  # until it is at full speed
        monitor.limit(Twist(0.4), known(i * 20_000_000, SE2(-3.0, 0.0), X_WO), i * 20_000_000)
    now_ns = 2_000_000_000
    X_WA = SE2(2.0 - 0.06 - 0.118 - 0.20, 0.0)
    late, prompt = (
        not_none(monitor.limit(Twist(0.4), known(now_ns - age_ns, X_WA, X_WO), now_ns).clearance)
        for age_ns in (150_000_000, 0)
    )
    assert prompt.distance - late.distance == pytest.approx(0.06, abs=1e-3)


def test_distances_in_the_wrong_order_are_refused() -> None:
    with pytest.raises(ValueError, match="slow_m has to be larger"):
        GuardSpec(slow_m=0.02, stop_m=0.03)


def test_the_monitor_keeps_more_clearance_than_the_judge_demands() -> None:
    scene = load_scene("bystander")
    assert scene.control.guard.stop_m > scene.judge.min_clearance_m


#: Pose of the post of :func:`open_arena`.
X_W_POST = SE2(0.1, 0.3)


@pytest.mark.parametrize(("seed", "course"), [(1, 0.3), (2, 2.0), (3, -1.4), (4, -2.8)])
def test_a_unit_that_sees_rendered_images_stops_in_front_of_a_post(
    open_arena: Callable, seed: int, course: float
) -> None:
    X_start = SE2(X_W_POST.x, X_W_POST.y, course) @ SE2(-0.7, 0.05 * (seed - 2), 0.1)
    arena = open_arena(seed, plant="bullet", start=X_start)
    monitor, model = (
        CollisionMonitor(arena.scene, "a", arena.scene.docks[0]),
        ClearanceModel.from_scene(arena.scene),
    )
    states, gaps = [], []

    def pursue(t: float, arena_estimate: ArenaEstimate | None) -> Twist:
        if arena_estimate is None:
            return Twist()
        p = arena_estimate.own.X_WB.inverse().act(X_W_POST.translation)
        command = Twist(0.4, max(-1.5, min(1.5, 4.0 * math.atan2(p[1], p[0]))))
        decision = monitor.limit(command, arena_estimate, arena.plant.now_ns())
        states.append(decision.state)
        return decision.twist

    def watch() -> None:
        nearest = not_none(model.minimum({"a": arena.plant.pose("a") @ OFFSET, "post": X_W_POST}))
        gaps.append(nearest.distance)

    arena.law = pursue
    arena.run(4.5, watch)
    spec = arena.scene.control.guard
    assert spec.stop_m - 0.002 < min(gaps) < spec.slow_m
    assert min(gaps) > arena.scene.judge.min_clearance_m
    assert states[0] is MonitorState.FREE
    assert states[-1] is not MonitorState.FREE


def test_a_stall_names_the_body_at_which_the_monitor_holds_the_unit(
    shipped: Callable[..., Scene], tmp_path: Path
) -> None:
    """A post appears before a unit that docks: decisions are logged, the attempt ends with its name."""
    post = {f"obstacles.post.pose.{k}": v for k, v in (("x_m", "-0.05"), ("y_m", "0.0"))}
    appears = {"obstacles.post.appears_at_s": "10.5", "docking.attempts": "1"}
    scene = shipped("bystander", {**post, **appears}, blind=True)
    with McapRecorder(tmp_path / LOG_NAME, LogHeader.of(scene, 1, {})) as recorder:
        result = Trial(scene, 1, recorder=recorder).run()
    reason = result.steps[0].belief_reason
    assert re.search(r"held for 2\.0 s by the collision monitor: \d+ mm to post", reason)
    log = read_log(tmp_path)
    decisions = [message for _, message in log.messages(CollisionMonitorState)]
    assert len(decisions) == len(list(log.messages(Action)))
    stopped = [d for d in decisions if d.state is MonitorState.STOP]
    assert stopped
    assert all(d.body == "post" and d.clearance is not None and d.clearance < 0.06 for d in stopped)
    assert replay(tmp_path).identical
