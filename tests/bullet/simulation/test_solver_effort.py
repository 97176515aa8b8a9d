"""The solver does many iterations wherever two units touch, and few where none can."""

import pybullet
import pytest

from msrr_bullet.simulation.solver_effort import CONTACT_ITERATIONS, FREE_ITERATIONS
from msrr_scenes.geometry.se2 import SE2
from tests.bullet.conftest import bench


def iterations(world):
    return pybullet.getPhysicsEngineParameters(physicsClientId=world.client)["numSolverIterations"]


@pytest.mark.parametrize("start", [SE2(-0.2, 0.004, 0.05), SE2(-0.2, 0.03, 0.0)])
def test_units_touch_only_while_the_solver_expects_it(start):
    with bench("bullet", start) as b:
        world = b.plant.world
        a, other = (world.unit(name).body for name in ("a", "b"))
        seen, touched = [], 0
        for _ in range(90):
            b.drive(0.15, 4.0 / 240.0)
            seen.append(iterations(world))
            if pybullet.getContactPoints(a, other, physicsClientId=world.client):
                touched += 1
                assert seen[-1] == CONTACT_ITERATIONS
        assert touched > 5
        # At first the units are too far apart to touch.
        assert set(seen) == {FREE_ITERATIONS, CONTACT_ITERATIONS}


def test_units_that_are_locked_together_cannot_touch_each_other():
    with bench("bullet", SE2(-0.01, 0.0, 0.0)) as b:
        b.dock()
        b.drive(0.0, 0.5)
        assert b.plant.lock_engaged("a")
        assert iterations(b.plant.world) == FREE_ITERATIONS
        b.plant.set_lock("a", False)
        b.drive(-0.02, 1.0)
        assert not b.plant.lock_engaged("a")
        assert iterations(b.plant.world) == CONTACT_ITERATIONS
