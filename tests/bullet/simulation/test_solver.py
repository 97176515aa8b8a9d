"""The solver stops early only where that changes next to nothing."""

import math

import pybullet
import pytest

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
