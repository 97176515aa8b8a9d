"""The environment of a trial: locked pairs over the steps of a plan, and what it closes."""

from __future__ import annotations

from collections.abc import Callable

import pybullet
import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.simulation.simulation import Simulation
from msrr_bullet.trial.environment import LockedPairs, open_environment
from msrr_bullet.trial.judge import Judge
from msrr_scenes.as_built import as_designed
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import bench

Load = Callable[..., Scene]


def test_locked_pairs_hold_as_long_as_all_locks_hold() -> None:
    """A docked pair that is locked, and then opened."""
    with bench("unicycle", SE2(-0.02, 0.0, 0.0)) as b:
        locked = LockedPairs()
        assert locked.opened(b.plant) is None  # no pair, nothing to hold
        b.dock()
        locked.add(b.scene.plan[0])
        assert locked.pairs == {frozenset("ab")}
        assert locked.opened(b.plant) is None
        b.plant.set_lock("a", False)
        assert locked.opened(b.plant) is b.scene.plan[0]


def test_an_environment_is_complete_and_closed_at_the_end(shipped: Load) -> None:
    scene = shipped("three_units")
    with open_environment(scene, 3) as environment:
        simulation = environment.simulation
        assert simulation.world is not None
        client = simulation.world.client
        assert environment.devices.encoders.keys() == scene.units.keys()
        assert environment.locked.pairs == set()
        clearances = environment.clearance.query(simulation.poses())
        bodies = {name for clearance in clearances for name in clearance.pair}
        assert bodies == simulation.poses().keys()
        simulation.plant.command("a", Twist(0.1))
        simulation.plant.step()
    assert not pybullet.isConnected(client)


def test_how_near_neighbours_may_be_follows_the_locks() -> None:
    """The corners of a unit behind b and of one at its side are 23 mm apart; another 5 mm are granted."""
    units = {name: {"number": i} for i, name in enumerate("abc")}
    plan = [{"unit": "a", "to": "b.rear"}]
    scene = Scene.model_validate({"name": "corner", "plant": "unicycle", "units": units, "plan": plan})
    placement = Placement({name: SE2(float(i), 0.0) for i, name in enumerate("abc")}, {})
    simulation = Simulation(scene, as_designed(scene), placement, KinematicPlant(scene, placement), None)
    locked = LockedPairs()
    judge = Judge(simulation, ClearanceModel.from_scene(scene), locked, scene.plan[0])
    assert judge.neighbour_limits() == {}
    locked.add(DockStep(unit="c", to="b.left"))
    assert judge.neighbour_limits() == {frozenset("ac"): pytest.approx(0.0183, abs=1e-4)}
    locked.remove("c")
    assert judge.neighbour_limits() == {}
