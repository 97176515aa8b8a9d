"""The solver stops early only where that changes next to nothing."""

import math
from dataclasses import replace

import pybullet
import pytest

from msrr_bullet.bench.physics_alone import note_commands
from msrr_bullet.profiler import NullProfiler
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Twist
from tests.bullet.conftest import bench


def poses_after(start, commands, **solver):
    """Return the poses of both units after commands of 0.5 s each; ``solver`` are parameters of PyBullet."""
    with bench("bullet", start) as b:
        pybullet.setPhysicsEngineParameter(physicsClientId=b.plant.world.client, **solver)
        for command in commands:
            b.plant.command("a", command)
            for _ in range(120):
                b.plant.step()
        return [b.plant.pose(name) for name in "ab"]


@pytest.mark.parametrize(
    ("start", "commands"),
    [
        # In bends, in which four times as many ticks would put the unit 0.3 mm aside.
        (SE2(-0.3, 0.02, 0.1), (Twist(0.15, 0.3), Twist(0.15, -0.4))),
        # A pin against the edge of a mouth, which pushes the target; 50 iterations put it 0.7 mm aside.
        (SE2(-0.03, 0.02, 0.0), (Twist(0.05, 0.0), Twist(0.05, 0.0))),
    ],
)
def test_units_come_to_where_a_converged_solver_takes_them(start, commands):
    converged = poses_after(start, commands, numSolverIterations=1000, solverResidualThreshold=0.0)
    for pose, other in zip(poses_after(start, commands), converged, strict=True):
        assert math.hypot(pose.x - other.x, pose.y - other.y) < 1e-4
        assert pose.yaw == pytest.approx(other.yaw, abs=math.radians(0.05))


@pytest.mark.nightly
def test_the_bound_of_the_solver_costs_less_than_the_length_of_a_tick(shipped, monkeypatch):
    """By the same commands. What four times as many ticks change is what the length of a tick costs."""
    by_solver, by_tick = [], []
    for seed in range(3):
        noted = note_commands(shipped("two_units"), seed, NullProfiler())
        _, here = noted.replay()
        with monkeypatch.context() as context:
            context.setattr("msrr_bullet.simulation.solver.CONVERGED_MPS", 0.0)
            context.setattr("msrr_bullet.simulation.solver.MOST_ITERATIONS", 1000)
            _, converged = noted.replay()
            _, finer = replace(noted, scene=shipped("two_units", {"physics_hz": 960})).replay()
        for unit in "ab":
            by_solver.append(math.dist(here[unit].translation, converged[unit].translation))
            by_tick.append(math.dist(finer[unit].translation, converged[unit].translation))
    print(
        f"off by up to {1e3 * max(by_solver):.1f} mm by the solver, {1e3 * max(by_tick):.1f} mm by the tick"
    )
    assert max(by_solver) < 0.5 * max(by_tick)
