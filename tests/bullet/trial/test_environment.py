"""The environment of a trial: locked pairs over the steps of a plan, and what it closes."""

from __future__ import annotations

from collections.abc import Callable

import pybullet

from msrr_bullet.trial.environment import LockedPairs, open_environment
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene

Load = Callable[..., Scene]


def test_locked_pairs_hold_as_long_as_all_locks_hold(bench) -> None:
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
    with open_environment(scene, 3, draw_placement(scene, lambda name: stream(3, name))) as environment:
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
