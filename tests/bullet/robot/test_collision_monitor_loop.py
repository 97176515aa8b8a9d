"""The clearance guard on what the robot sees: rendered pictures, contact physics, a hostile law."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.robot.collision_monitor import CollisionMonitor, MonitorState
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ArenaEstimate, Twist

#: A hair aside of the true pose: FCL fails where a face looks straight at a disc.
ASIDE = SE2(2e-4, 3e-4, 2e-4)
X_WO = SE2(0.1, 0.3)


@pytest.mark.parametrize(("seed", "course"), [(1, 0.3), (2, 2.0), (3, -1.4), (4, -2.8)])
def test_driven_at_a_post_at_full_speed_it_stops_before_it(
    open_arena: Callable, seed: int, course: float
) -> None:
    X_start = SE2(X_WO.x, X_WO.y, course) @ SE2(-0.7, 0.05 * (seed - 2), 0.1)
    arena = open_arena(seed, plant="bullet", start=X_start)
    guard, model = CollisionMonitor(arena.scene, arena.scene.plan[0]), ClearanceModel.from_scene(arena.scene)
    states, gaps = [], []

    def hostile(t: float, known: ArenaEstimate | None) -> Twist:
        if known is None:
            return Twist()
        p = known.own.X_WB.inverse().act(X_WO.translation)
        wish = Twist(0.4, max(-1.5, min(1.5, 4.0 * math.atan2(p[1], p[0]))))
        decision = guard.limit(wish, known, arena.plant.now_ns())
        states.append(decision.state)
        return decision.twist

    def watch() -> None:
        nearest = model.minimum({"a": arena.plant.pose("a") @ ASIDE, "post": X_WO})
        assert nearest is not None
        gaps.append(nearest.distance)

    arena.law = hostile
    arena.run(4.5, watch)
    spec = arena.scene.control.guard
    assert spec.stop_m - 0.002 < min(gaps) < spec.slow_m
    assert min(gaps) > arena.scene.judge.min_clearance_m
    assert states[0] is MonitorState.FREE
    assert states[-1] is not MonitorState.FREE
