"""Two units that drive: where each would stop is told, and the one that goes after keeps out of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ArenaEstimate, GlobalPose, MonitorState, Twist
from msrr_scenes.messages.coordination import Authority, Intent
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene

TIGHT = np.diag([1e-7, 1e-7, 1e-7])
PERIOD_NS = 20_000_000


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "two",
            "plant": "unicycle",
            "units": {"a": {"number": 0}, "b": {"number": 1}},
            "cameras": {"overhead": {}},
            "plan": [{"move": "a", "pose": {"x_m": 1.0}}],
        }
    )


def seen(now_ns: int, own: str, poses: dict[str, SE2]) -> ArenaEstimate:
    known = {name: GlobalPose(name, now_ns, X, TIGHT) for name, X in poses.items()}
    others = tuple(known[name] for name in poses if name != own)
    return ArenaEstimate(now_ns, known[own], None, others, (), now_ns)


def told(unit: str, *intents: Intent) -> Authority:
    return Authority(unit, 1, 1, 0, 1, 1.0, (), None, unlock=False, intents=intents)


def head_on(scene: Scene, gap: float) -> dict[str, SE2]:
    """Two units that face each other, with ``gap`` [m] between their fronts."""
    front = float(scene.geometry("a").footprint[:, 0].max())
    return {"a": SE2(), "b": SE2(2.0 * front + gap, 0.0, math.pi)}


@pytest.mark.parametrize(("v", "w"), [(0.25, 0.0), (0.2, 0.8), (-0.15, -0.3)])
def test_the_last_pose_that_is_told_is_where_the_unit_stops(scene: Scene, v: float, w: float) -> None:
    plant = KinematicPlant(scene, Placement({"a": SE2(0.1, -0.2, 0.4), "b": SE2(1.5, 1.0, 0.0)}, {}))
    monitor = CollisionMonitor(scene, "a")

    def arena() -> ArenaEstimate:
        return seen(plant.now_ns(), "a", {name: plant.pose(name) for name in scene.units})

    assert monitor.stopping(arena(), 0) == (), "it stands"
    due_ns = 0
    while plant.now_ns() < 1_000_000_000:
        if plant.now_ns() >= due_ns:
            plant.command("a", monitor.limit(Twist(v, w), arena(), plant.now_ns()).twist)
            due_ns += PERIOD_NS
        plant.step()
    poses = monitor.stopping(arena(), plant.now_ns())
    plant.command("a", Twist())
    while plant.now_ns() < 3_000_000_000:
        plant.step()
    end = plant.pose("a").inverse() @ SE2(*poses[-1])
    # The prediction is made for one command more, and rather too long than too short.
    assert math.hypot(end.x, end.y) < 0.02


def test_the_one_that_goes_after_keeps_out_of_where_the_other_would_stop(scene: Scene) -> None:
    """20 cm between the fronts are enough for a unit that stands there, and not for one that comes nearer."""
    poses = head_on(scene, 0.20)
    other = poses["b"] @ SE2(0.18, 0.0, 0.0)
    intent = Intent("b", 0, ((other.x, other.y, other.yaw),))

    def decision(*intents: Intent, now_ns: int = 0) -> MonitorState:
        monitor = CollisionMonitor(scene, "a")
        monitor.brief(told("a", *intents))
        return monitor.limit(Twist(0.2), seen(now_ns, "a", poses), now_ns).state

    assert decision() is MonitorState.FREE
    assert decision(intent) is MonitorState.STOP
    assert decision(intent, now_ns=999_999_999) is MonitorState.STOP
    assert decision(intent, now_ns=1_000_000_000) is MonitorState.FREE, "it is too old to tell anything"
    assert decision(Intent("c", 0, intent.poses)) is MonitorState.FREE, "nobody knows where that one is"


def test_of_two_that_meet_head_on_one_may_go_on(scene: Scene) -> None:
    """Only the one that goes after is told of the other: so they do not both yield for ever."""
    poses = head_on(scene, 0.5)
    plant = KinematicPlant(scene, Placement(poses, {}))
    monitors = {name: CollisionMonitor(scene, name) for name in scene.units}
    least, way = math.inf, 0.0
    sides = {"a": Twist(0.2), "b": Twist(0.2, 0.9)}  # b turns aside, and goes first
    due_ns = 0
    start = plant.pose("b")
    front = monitors["a"]
    while plant.now_ns() < 4_000_000_000:
        now_ns = plant.now_ns()
        if now_ns >= due_ns:
            due_ns += PERIOD_NS
            where = {name: plant.pose(name) for name in scene.units}
            stopping = monitors["b"].stopping(seen(now_ns, "b", where), now_ns)
            front.brief(told("a", *([Intent("b", now_ns, stopping)] if stopping else [])))
            for name, monitor in monitors.items():
                limited = monitor.limit(sides[name], seen(now_ns, name, where), now_ns)
                plant.command(name, limited.twist)
            apart = where["a"].inverse() @ where["b"]
            least = min(least, math.hypot(apart.x, apart.y))
        plant.step()
    X = start.inverse() @ plant.pose("b")
    way = abs(X.yaw) + math.hypot(X.x, X.y)
    assert way > 0.3, "b was not held up"
    assert least > 2.0 * float(np.abs(scene.geometry("a").footprint[:, 1]).max()), "they did not touch"
