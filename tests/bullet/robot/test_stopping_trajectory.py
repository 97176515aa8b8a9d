"""The uncertainty of distances, and the trajectory of a command against a simulated drive."""

from __future__ import annotations

import math
from collections.abc import Collection
from itertools import pairwise

import numpy as np
import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_bullet.robot.local_map import LocalMap
from msrr_bullet.robot.stopping_trajectory import StoppingTrajectory
from msrr_bullet.sensors.command_link import CommandLink
from msrr_bullet.sensors.schedule import Periodic
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    GlobalPose,
    MonitorState,
    ObstacleEstimate,
    Phase,
    Twist,
)
from msrr_scenes.messages.coordination import Intent
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.deviations import DelayDeviation
from msrr_scenes.specs.scene import Scene

POST = {"shape": "cylinder", "radius_m": 0.06, "height_m": 0.2, "tag_id": 500}
NOTHING = np.zeros((3, 3))
REACHES = {"a": 0.15, "b": 0.2, "post": 0.06}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "arena",
            "plant": "unicycle",
            "units": {"a": {"number": 0}, "b": {"number": 1}},
            "obstacles": {"post": POST},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


def _known(X_WA: SE2, own: np.ndarray, target: np.ndarray, post: np.ndarray) -> ArenaEstimate:
    return ArenaEstimate(
        0,
        GlobalPose("a", 0, X_WA, own),
        GlobalPose("b", 0, SE2(1.8, 1.3, 0.5), target),
        (),
        (ObstacleEstimate("post", 0, SE2(), post, 0.06),),
        0,
    )


def _sigmas(
    scene: Scene, own: np.ndarray, target: np.ndarray = NOTHING, post: np.ndarray = NOTHING
) -> dict[str, float]:
    return LocalMap(
        ClearanceModel.from_scene(scene), _known(SE2(-1.0, 0.0), own, target, post), REACHES, ["b", "post"]
    ).sigmas


@pytest.mark.parametrize(
    ("sigma_x", "sigma_y", "correlation", "sigma_yaw"),
    [
        (0.0, 0.0, 0.0, 0.05),
        (0.01, 0.01, 0.0, 0.0),
        (0.01, 0.01, 0.0, 0.1),
        (0.02, 0.004, 0.0, 0.02),
        (0.01, 0.008, 0.8, 0.06),
        (0.01, 0.008, -0.8, 0.06),
    ],
)
def test_sigma_is_that_of_the_least_known_point_and_direction(
    scene: Scene, sigma_x: float, sigma_y: float, correlation: float, sigma_yaw: float
) -> None:
    """Random poses move the points on a circle about the unit, in one direction by sigma, in none by more.

    20000 draws: the standard error of a standard deviation is 0.5 %.
    """
    P = np.diag([sigma_x**2, sigma_y**2, sigma_yaw**2])
    P[0, 1] = P[1, 0] = correlation * sigma_x * sigma_y
    x, y, yaw = np.random.default_rng(6).multivariate_normal(np.zeros(3), P, 20_000).T
    directions = np.linspace(0.0, math.pi, 61)
    worst = 0.0
    for angle in np.linspace(0.0, 2.0 * math.pi, 25):
        px = x + REACHES["a"] * (np.cos(angle + yaw) - math.cos(angle))
        py = y + REACHES["a"] * (np.sin(angle + yaw) - math.sin(angle))
        worst = max(worst, *(float(np.std(math.cos(d) * px + math.sin(d) * py)) for d in directions))
    assert _sigmas(scene, P)["post"] == pytest.approx(worst, rel=0.025)


def test_sigma_of_simple_covariances(scene: Scene) -> None:
    """A yaw error counts by the reach of the body, and for no body but that one."""
    turn = np.diag([0.0, 0.0, 0.1**2])

    def both(b: float, post: float) -> object:
        return pytest.approx({"b": b, "post": post})

    assert _sigmas(scene, turn) == both(0.015, 0.015)  # 0.15 m x 0.1
    assert _sigmas(scene, NOTHING, target=turn) == both(0.02, 0.0)
    assert _sigmas(scene, NOTHING, post=turn) == both(0.0, 0.006)
    assert _sigmas(scene, turn, target=turn, post=turn) == both(
        math.hypot(0.015, 0.02), math.hypot(0.015, 0.006)
    )
    place = np.diag([0.03**2, 0.0, 0.0])
    assert _sigmas(scene, place, target=turn) == both(math.hypot(0.03, 0.02), 0.03)
    assert _sigmas(scene, place + turn) == both(math.hypot(0.03, 0.015), math.hypot(0.03, 0.015))


@pytest.mark.parametrize("x_m", [-0.6, -0.3, -0.24])
def test_a_badly_known_body_elsewhere_does_not_blur_a_near_one(scene: Scene, x_m: float) -> None:
    """The unit decides on a post as if the other body, 1.8 m away and known to 0.2 m, were not there."""
    rough = np.diag([0.2**2, 0.2**2, 0.0])
    for command in (Twist(0.15), Twist(0.4, 0.5), Twist(-0.1)):
        certain, uncertain = (
            CollisionMonitor(scene, "a", scene.docks[0]).limit(
                command, _known(SE2(x_m, 0.0), NOTHING, target, NOTHING), 0
            )
            for target in (NOTHING, rough)
        )
        assert certain == uncertain


def test_the_monitor_subtracts_an_uncertain_heading_from_the_clearance(scene: Scene) -> None:
    """4 deg of heading are 9 mm at the corner of a unit, and 18 mm at two standard deviations."""
    X_WA, command = SE2(-0.06 - 0.118 - 0.05, 0.0, 0.0), Twist(0.15)
    turn = np.diag([0.0, 0.0, math.radians(4.0) ** 2])
    certain, uncertain = (
        CollisionMonitor(scene, "a", scene.docks[0]).limit(command, _known(X_WA, P, NOTHING, NOTHING), 0)
        for P in (NOTHING, turn)
    )
    assert certain.state is MonitorState.FREE
    assert uncertain.state is not MonitorState.FREE
    reach = scene.geometry("a").circumradius
    expected = scene.control.guard.sigmas * reach * math.radians(4.0)
    assert certain.ahead - uncertain.ahead == pytest.approx(expected, abs=0.002)


@pytest.mark.parametrize(
    ("latency_ms", "sigma_ms", "lag_ms"),
    [(0.0, 0.0, 0.0), (50.0, 0.0, 0.0), (0.0, 200.0, 0.0), (50.0, 200.0, 200.0), (50.0, 200.0, 390.0)],
)
@pytest.mark.parametrize("seed", range(12))
def test_a_simulated_unit_keeps_the_predicted_clearance(
    scene: Scene, seed: int, latency_ms: float, sigma_ms: float, lag_ms: float
) -> None:
    """Random commands, then one more, then commands to stop: a plant with a link against the prediction.

    The drive lags by up to two standard deviations of what is told.
    """
    drive = scene.as_built.drive.model_copy(
        update={"lag_ms": DelayDeviation(sigma=sigma_ms, error=lag_ms if sigma_ms else None)}
    )
    changes = {
        "link": scene.link.model_copy(update={"latency_ms": latency_ms}),
        "as_built": scene.as_built.model_copy(update={"drive": drive}),
    }
    scene = scene.model_copy(update=changes)
    rng = np.random.default_rng(seed)
    start, X_WB = (
        SE2(-0.5, float(rng.uniform(-0.15, 0.15)), float(rng.uniform(-0.5, 0.5))),
        SE2(1.8, 1.3, 0.5),
    )
    plant = KinematicPlant(
        scene, Placement({"a": start, "b": X_WB}, {"post": SE2()}), built=draw_as_built(scene, 0)
    )
    link = CommandLink(scene.link, np.random.default_rng(0))
    trajectory, control = StoppingTrajectory(scene), Periodic(scene.control.rate_hz)
    model, reach = ClearanceModel.from_scene(scene), scene.geometry("a").circumradius
    local_map = LocalMap(
        model, _known(start, NOTHING, NOTHING, NOTHING), {**REACHES, "a": reach}, {"b", "post"}
    )
    predicted = bound = math.inf
    distances, travel, instants, speed = [], 0.0, 0, np.zeros(2)
    while not distances or plant.twist("a") != Twist() or instants < 60:
        now_ns = plant.now_ns()
        if control.due(now_ns):
            instants += 1
            speed = rng.uniform([0.0, -1.0], [0.4, 1.0]) if instants % 10 == 1 else speed
            command = Twist(*speed) if instants <= 25 else Twist()
            trajectory.advance(now_ns)
            if instants == 25:
                X_WU = plant.pose("a")
                present = local_map.distance(X_WU)
                predicted = trajectory.min_clearance(command, X_WU, present, local_map, threshold=10.0)
                bound = trajectory.max_travel(command, reach)
            trajectory.send(command)
            link.send(Action(now_ns, Phase.ASSEMBLE, 1, command))
        if (arrived := link.arrived(now_ns)) is not None:
            plant.command("a", arrived.twist)
        plant.step()
        if instants >= 25:
            twist = plant.twist("a")
            travel += (abs(twist.v) + reach * abs(twist.w)) / scene.physics_hz
            distances.append(local_map.distance(plant.pose("a")))
        if instants > 200:
            break
    assert predicted <= min(distances) + 1e-3
    assert predicted >= min(distances) - 0.03 or sigma_ms
    assert travel <= bound


@pytest.mark.parametrize("latency_ms", [0.0, 255.0, 500.0])
@pytest.mark.parametrize("rate_hz", [10.0, 33.0, 100.0])
def test_the_predicted_trajectory_ends_where_a_simulated_unit_does(
    scene: Scene, rate_hz: float, latency_ms: float
) -> None:
    """To 1.5 mm and 5 mrad, after a second of commands of which each is another one.

    Where commands arrived in whole steps of 10 ms, and a drive took one step from command to command, it was
    5 mm and 14 mrad.
    """
    changes = {
        "link": scene.link.model_copy(update={"latency_ms": latency_ms}),
        "control": scene.control.model_copy(update={"rate_hz": rate_hz}),
    }
    scene = scene.model_copy(update=changes)
    for seed in range(6):
        rng, start = np.random.default_rng(seed), SE2(-0.5, 0.1, 0.3)
        plant = KinematicPlant(scene, Placement({"a": start, "b": SE2(1.8, 1.3, 0.5)}, {"post": SE2()}))
        link, trajectory = CommandLink(scene.link, np.random.default_rng(0)), StoppingTrajectory(scene)
        control, predicted = Periodic(rate_hz), None
        while (now_ns := plant.now_ns()) < 4e9:
            if control.due(now_ns):
                command = Twist(*rng.uniform([-0.1, -1.0], [0.4, 1.0])) if predicted is None else Twist()
                trajectory.advance(now_ns)
                if predicted is None and now_ns > 1e9:
                    *_, (x, y, yaw, _) = trajectory._poses(command, 0.15)
                    predicted = plant.pose("a") @ SE2(x, y, yaw)
                trajectory.send(command)
                link.send(Action(now_ns, Phase.ASSEMBLE, 1, command))
            if (arrived := link.arrived(now_ns)) is not None:
                plant.command("a", arrived.twist)
            plant.step()
        assert predicted is not None
        off = predicted.inverse() @ plant.pose("a")
        assert math.hypot(off.x, off.y) < 1.5e-3
        assert abs(off.yaw) < 5e-3


def test_no_smaller_clearance_on_the_way_is_missed(scene: Scene) -> None:
    """Beside a post, at speed: measured after each centimetre, against measurements at every pose.

    What is above the threshold does not matter. In some cases a unit is nearest to the post on its way, and
    not at its end.
    """
    scene = scene.model_copy(update={"link": scene.link.model_copy(update={"latency_ms": 800.0})})
    rng, model, on_the_way, matters = np.random.default_rng(4), ClearanceModel.from_scene(scene), 0, 0
    reaches = {**REACHES, "a": scene.geometry("a").circumradius}
    for _ in range(60):
        before, command = (
            Twist(float(rng.choice([-0.4, 0.4])), float(rng.uniform(-0.8, 0.8))) for _ in range(2)
        )
        side = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.15, 0.3))
        X_WU = SE2(-0.2 * math.copysign(1.0, before.v), side, float(rng.uniform(-0.4, 0.4)))
        trajectory = StoppingTrajectory(scene)
        for k in range(100):
            trajectory.advance(k * 20_000_000)
            trajectory.send(before)
        local_map = LocalMap(model, _known(X_WU, NOTHING, NOTHING, NOTHING), reaches, ["post"])
        present = local_map.distance(X_WU)
        poses = [SE2(x, y, yaw) for x, y, yaw, _ in trajectory._poses(command, reaches["a"])]
        distances = [present, *(local_map.distance(X_WU @ X) for X in poses)]
        smallest = min(distances)
        on_the_way += smallest < min(present, distances[-1]) - 0.02
        for threshold in (0.03, 0.08, 0.15):
            found = trajectory.min_clearance(command, X_WU, present, local_map, threshold)
            assert found >= smallest - 1e-9
            if smallest < threshold:
                matters += 1
                assert found <= smallest + 0.002
    assert on_the_way >= 5
    assert matters >= 40


def test_the_end_of_the_way_is_measured_wherever_it_is(scene: Scene) -> None:
    """Straight at a post, from distances that differ by a millimetre; at most ends no measurement is due."""
    model, reaches = ClearanceModel.from_scene(scene), {**REACHES, "a": scene.geometry("a").circumradius}
    trajectory, command, threshold, matters = StoppingTrajectory(scene), Twist(0.2), 0.03, 0
    for k in range(60):
        trajectory.advance(k * 20_000_000)
        trajectory.send(command)
    *_, (x, y, yaw, _) = trajectory._poses(command, reaches["a"])
    for mm in range(210, 270):
        X_WU = SE2(-1e-3 * mm, 0.0, 0.0)
        local_map = LocalMap(model, _known(X_WU, NOTHING, NOTHING, NOTHING), reaches, ["post"])
        end = local_map.distance(X_WU @ SE2(x, y, yaw))
        found = trajectory.min_clearance(command, X_WU, local_map.distance(X_WU), local_map, threshold)
        if end < threshold:
            matters += 1
            assert found == pytest.approx(end, abs=1e-4)
        else:
            assert found >= threshold
    assert 20 < matters < 50


def test_a_trajectory_ends_when_both_speeds_have_fallen_and_nothing_is_under_way(scene: Scene) -> None:
    """And not before a brake that takes seconds has stopped the unit."""
    slow = {"a_max_mps2": 0.1, "dw_max_radps2": 0.4}
    scene = scene.model_copy(update={"limits": scene.limits.model_copy(update=slow)})
    for command in (Twist(0.3, 0.0), Twist(0.0, 1.2), Twist(0.3, -0.2)):
        trajectory = StoppingTrajectory(scene)
        for k in range(300):
            trajectory.advance(k * 20_000_000)
            trajectory.send(command)
        *_, (x, y, yaw, _) = trajectory._poses(Twist(), 0.1)
        assert math.hypot(x, y) >= 0.5 * command.v**2 / 0.1 - 0.005
        assert abs(yaw) >= 0.5 * command.w**2 / 0.4 - 0.01


def test_commands_under_way_are_driven_before_the_new_one_arrives(scene: Scene) -> None:
    """At rest, 0.1 s of latency: a stop that is sent now does not stop the commands that are on the link."""
    scene = scene.model_copy(update={"link": scene.link.model_copy(update={"latency_ms": 100.0})})
    X_WU, reach = SE2(-0.4, 0.0, 0.0), REACHES["a"]
    local_map = LocalMap(
        ClearanceModel.from_scene(scene), _known(X_WU, NOTHING, NOTHING, NOTHING), REACHES, ["post"]
    )
    present = local_map.distance(X_WU)

    def way(under_way: str) -> float:
        """How far a stop leads behind commands sent every 20 ms: ``F`` forward, ``S`` stop."""
        trajectory, now_ns = StoppingTrajectory(scene), 0
        for letter in under_way:
            trajectory.advance(now_ns)
            trajectory.send(Twist(0.4 if letter == "F" else 0.0))
            now_ns += 20_000_000
        trajectory.advance(now_ns)
        clearance = trajectory.min_clearance(Twist(), X_WU, present, local_map, threshold=10.0)
        assert present - clearance <= trajectory.max_travel(Twist(), reach) + 1e-9
        return present - clearance

    assert way("") == way("SSS") == pytest.approx(0.0, abs=1e-9)
    # Each command is in force until the next one arrives, so each of them makes the way longer.
    assert 1e-5 < way("SSF") < 0.7 * way("SFF") < 0.5 * way("FFF")
    # What counts is for how long a command is in force (20 ms are two steps of the prediction, give or take
    # one), not whether it is the first or the last.
    assert 0.5 * way("SSF") < way("FSS") < 2.0 * way("SSF")


@pytest.mark.parametrize(
    "command", [Twist(0.3, 1.2), Twist(-0.2, -0.9), Twist(0.3, 0.0), Twist(0.0, 1.0)], ids=str
)
def test_the_predicted_way_is_made_of_arcs(scene: Scene, command: Twist) -> None:
    """A unit at speed that is told to stop: from pose to pose along one arc each, against exp on SE(2)."""
    trajectory = StoppingTrajectory(scene)
    for k in range(60):
        trajectory.advance(k * 20_000_000)
        trajectory.send(command)
    X, turned = SE2(), 0.0
    for x, y, yaw, travel in trajectory._poses(Twist(), 0.1):
        length = math.copysign(travel - 0.1 * abs(yaw - turned), command.v)
        end = X @ SE2.exp(length if command.v else 0.0, 0.0, yaw - turned)
        np.testing.assert_allclose([x, y], end.translation, atol=1e-9)
        X, turned = SE2(x, y, yaw), yaw
    assert X.yaw * command.w >= 0.05 * command.w**2
    assert X.x * command.v >= 0.1 * command.v**2
    # The longest turn: at speed until the command is in force and followed, then as hard as the drive brakes.
    lag_s = 1.0 / scene.control.rate_hz + 0.02 + 1.0 / scene.limits.kappa_per_s
    assert abs(X.yaw) <= abs(command.w) * lag_s + 0.5 * command.w**2 / scene.limits.dw_max_radps2 + 1e-9


@pytest.mark.parametrize("latency_ms", [0.0, 150.0])
@pytest.mark.parametrize(
    "command",
    [Twist(0.3, 0.0), Twist(-0.2, 0.9), Twist(0.0, 1.0), Twist(0.02, 0.0), Twist(0.0, 0.1)],
    ids=str,
)
def test_the_bound_of_the_travel_is_above_it_by_the_lag_of_the_drive_at_most(
    scene: Scene, command: Twist, latency_ms: float
) -> None:
    """At 10 Hz a period and the latency are longer than that lag: a bound with one too few or many fails.

    A slow unit goes nearly all of its way while its drive follows the stop.
    """
    changes = {
        "link": scene.link.model_copy(update={"latency_ms": latency_ms}),
        "control": scene.control.model_copy(update={"rate_hz": 10.0}),
    }
    trajectory, reach = StoppingTrajectory(scene.model_copy(update=changes)), 0.15
    for k in range(60):  # at speed, and so commanded by all that is on the link
        trajectory.advance(k * 100_000_000)
        trajectory.send(command)
    travel = sum(step for *_, step in trajectory._poses(command, reach))
    speed, lag_s = abs(command.v) + reach * abs(command.w), 1.0 / scene.limits.kappa_per_s
    assert lag_s < 1.0 / 10.0
    bound = trajectory.max_travel(command, reach)
    assert travel <= bound <= travel + speed * (lag_s + 0.02)
    for k in range(60, 64):  # told to stop, but still at speed
        trajectory.advance(k * 100_000_000)
        travel = sum(step for *_, step in trajectory._poses(Twist(), reach))
        assert travel <= trajectory.max_travel(Twist(), reach) + 1e-9
        trajectory.send(Twist())


def test_it_does_not_matter_how_often_the_drive_is_simulated(scene: Scene) -> None:
    """After a pause in which several commands arrived, each of them was in force for its time."""
    scene = scene.model_copy(update={"link": scene.link.model_copy(update={"latency_ms": 200.0})})
    rng, often, once = np.random.default_rng(2), StoppingTrajectory(scene), StoppingTrajectory(scene)
    for k in range(10):
        command = Twist(*rng.uniform([-0.1, -1.0], [0.4, 1.0]))
        for trajectory in (often, once):
            trajectory.advance(k * 20_000_000)
            trajectory.send(command)
    for k in range(10, 15):
        often.advance(k * 20_000_000)
    once.advance(14 * 20_000_000)
    ends = [[X.as_array() for X in one.stopping_poses(SE2(), 0.15)] for one in (often, once)]
    assert ends[0]
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-9)


def test_an_estimate_of_the_past_is_carried_on_in_the_heading_of_the_unit(scene: Scene) -> None:
    trajectory, before = (
        StoppingTrajectory(scene),
        GlobalPose("a", 4_900_000_000, SE2(1.0, 2.0, 0.8), NOTHING),
    )
    trajectory.advance(0)
    trajectory.send(Twist(0.2, 0.3))
    trajectory.advance(5_000_000_000)
    X_WU = trajectory.present_pose(before, 5_000_000_000)
    expected = before.X_WB @ SE2.exp(0.02, 0.0, 0.03)
    assert X_WU.as_array() == pytest.approx(expected.as_array(), abs=1e-6)
    assert trajectory.present_pose(before, before.stamp_ns) is before.X_WB
    assert trajectory.present_pose(before, before.stamp_ns - 1_000_000_000) is before.X_WB, "it is newer"


def test_a_unit_travels_as_far_backwards_and_to_the_right(scene: Scene) -> None:
    """By the command that is sent now, and by those that are on their way."""
    farthest = set()
    for sign in (1.0, -1.0):
        for sent, command in (
            (Twist(0.3 * sign, 0.5 * sign), Twist()),
            (Twist(), Twist(0.3 * sign, 0.5 * sign)),
        ):
            trajectory = StoppingTrajectory(scene)
            trajectory.advance(0)
            trajectory.send(sent)
            farthest.add(trajectory.max_travel(command, 0.2))
    assert len(farthest) == 1


@pytest.mark.parametrize("sent", [Twist(0.3, 0.0), Twist(0.0, 0.5)], ids=str)
def test_a_unit_travels_by_a_command_that_has_just_arrived(scene: Scene, sent: Twist) -> None:
    """It stands, and accelerates until the stop arrives that is sent now."""
    scene = scene.model_copy(update={"link": scene.link.model_copy(update={"latency_ms": 100.0})})
    trajectory = StoppingTrajectory(scene)
    trajectory.advance(0)
    trajectory.send(sent)
    trajectory.advance(100_000_000)
    travel = sum(step for *_, step in trajectory._poses(Twist(), 0.2))
    assert 0.0 < travel <= trajectory.max_travel(Twist(), 0.2)


@pytest.mark.parametrize("command", [Twist(0.4, 0.0), Twist(-0.3, 0.7), Twist(0.0, -1.5)], ids=str)
def test_the_poses_on_the_way_to_a_stop_are_told_every_5_cm(scene: Scene, command: Twist) -> None:
    """By the point of the unit that goes farthest, which goes up to 8 mm in a step; then where it stops."""
    trajectory, X_WU, reach = StoppingTrajectory(scene), SE2(0.3, -0.2, 2.9), 0.5
    assert trajectory.stopping_poses(X_WU, reach) == [], "it stands"
    for k in range(60):
        trajectory.advance(k * 20_000_000)
        trajectory.send(command)
    told = trajectory.stopping_poses(X_WU, reach)
    ways = []
    for before, after in pairwise([X_WU, *told]):
        off = before.inverse() @ after
        ways.append(math.hypot(off.x, off.y) + reach * abs(off.yaw))
    assert len(ways) >= 2
    assert all(0.049 < way < 0.058 for way in ways[:-1])
    assert 0.001 < ways[-1] < 0.058
    *_, (x, y, yaw, _) = trajectory._poses(Twist(), reach)
    assert told[-1].as_array() == pytest.approx((X_WU @ SE2(x, y, yaw)).as_array(), abs=2e-3)


@pytest.mark.parametrize(("v", "tells"), [(0.02, True), (0.005, False)])
def test_a_unit_that_would_stop_within_a_millimetre_is_at_rest(scene: Scene, v: float, tells: bool) -> None:
    """Until its stop is in force and followed, which takes more than a tenth of a second, it goes on."""
    trajectory = StoppingTrajectory(scene)
    for k in range(60):
        trajectory.advance(k * 20_000_000)
        trajectory.send(Twist(v))
    assert bool(trajectory.stopping_poses(SE2(), 0.2)) is tells


@pytest.mark.parametrize("seed", range(5))
def test_a_body_with_an_intent_is_as_near_as_it_is_or_will_be(scene: Scene, seed: int) -> None:
    """A map is as near as the nearest of those in which each body stands at one of its poses."""
    rng, model = np.random.default_rng(seed), ClearanceModel.from_scene(scene)
    reaches = {"a": scene.geometry("a").circumradius, "b": scene.geometry("b").circumradius, "post": 0.06}
    poses = [SE2(*rng.uniform([-1.0, -1.0, -3.0], [1.0, 1.0, 3.0]).tolist()) for _ in range(4)]
    X_WU, X_WP = SE2(*rng.uniform([-1.5, -1.5, -3.0], [1.5, 1.5, 3.0]).tolist()), SE2(0.3, -0.8, 0.0)

    def local_map(X_WB: SE2, names: Collection[str] = ("b", "post"), *intents: Intent) -> LocalMap:
        known = {"own": ("a", X_WU), "target": ("b", X_WB)}
        own, target = (GlobalPose(name, 0, X, 1e-4 * np.eye(3)) for name, X in known.values())
        post = ObstacleEstimate("post", 0, X_WP, 1e-6 * np.eye(3), 0.06)
        return LocalMap(model, ArenaEstimate(0, own, target, (), (post,), 0), reaches, names, intents)

    intent = Intent("b", 0, tuple((X.x, X.y, X.yaw) for X in poses[1:]))
    stranger = Intent("c", 0, ((X_WU.x, X_WU.y, X_WU.yaw),))
    whole, alone = local_map(poses[0], ("b", "post"), intent, stranger), [local_map(X) for X in poses]
    for place in (X_WU, *(X @ SE2(0.3, 0.2, turn) for X in poses for turn in range(6))):
        assert whole.distance(place) == min(one.distance(place) for one in alone)
    bounds = whole.bounds(X_WU, 2.0)
    assert bounds == {
        "b": min(one.bounds(X_WU, 2.0)["b"] for one in alone),
        "post": alone[0].bounds(X_WU, 2.0)["post"],
    }
    for name in ("b", "post"):
        part = whole.only([name])
        assert part.distance(X_WU) == local_map(poses[0], (name,), intent).distance(X_WU)
        assert part.bounds(X_WU, 2.0) == {name: bounds[name]}
        # The clearance is measured a third of a millimetre aside.
        gap = bounds[name] + 2.0 * whole.sigmas[name]  # of the circles about the two bodies
        assert gap <= part.distance(X_WU) + 4e-4
        assert part.distance(X_WU) <= gap + whole.reach + reaches[name] + 4e-4, "each contains its origin"
    worst = max(whole.only([name]).uncertainty(2.0) for name in ("b", "post"))
    assert whole.uncertainty(2.0) == worst > 0.0
    nobody = whole.only([])
    assert (nobody.distance(X_WU), nobody.bounds(X_WU, 2.0), nobody.clearance(X_WU)) == (math.inf, {}, None)
