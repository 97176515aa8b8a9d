"""Pairs that are assembled when a trial begins, and locks that jam, in both plants."""

from __future__ import annotations

import math
from functools import partial

import pytest

from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.simulation import open_simulation
from msrr_scenes import load_scene
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LockPosition, Twist
from msrr_scenes.placement.placement import Placement, draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene

PLANTS = ("bullet", "unicycle")


def _scene(kind: str, **overrides: str) -> Scene:
    return load_scene("reconfigure", {"plant": kind, "perception": "parametric", **overrides})


def _start(scene: Scene) -> Placement:
    return draw_placement(scene, partial(stream, 3))


@pytest.mark.parametrize("kind", PLANTS)
def test_an_assembly_is_seated_and_locked_from_the_start_and_stays_where_it_is(kind: str) -> None:
    scene = _scene(kind)
    start = _start(scene)
    with open_simulation(scene, start) as simulation:
        plant = simulation.plant
        for later in (False, True):
            for dock in scene.assembled_docks:
                assert plant.lock_engaged(dock.unit)
                assert plant.lock_position(dock.unit) is LockPosition.CLOSED
                assert plant.switches(dock.unit) == (True, True)
            for unit, X_WU in start.units.items():
                X = X_WU.inverse() @ plant.pose(unit)
                assert math.hypot(X.x, X.y) < 1e-4
                assert abs(X.yaw) < 1e-3
            for _ in range(0 if later else 240):
                plant.step()
        if isinstance(plant, BulletPlant):
            for _ in range(240):
                plant.step()
            assert all(plant.is_asleep(unit) for unit in scene.units), "what is locked and rests sleeps"
            plant.command("f", Twist(0.05, 0.0))
            assert not any(plant.is_asleep(unit) for unit in scene.units), "a locked group wakes as one"
            plant.command("f", Twist())
        for dock in scene.assembled_docks:
            assert plant.pull_test(dock.unit)


@pytest.mark.parametrize("kind", PLANTS)
def test_an_assembled_unit_leaves_its_port_as_after_a_docking(kind: str) -> None:
    scene = _scene(kind)
    with open_simulation(scene, _start(scene)) as simulation:
        plant = simulation.plant
        start = plant.pose("f")
        plant.set_lock("f", False)
        plant.command("f", Twist(-0.1, 0.0))
        for _ in range(480):
            plant.step()
        assert not plant.lock_engaged("f")
        assert (start.inverse() @ plant.pose("f")).x < -0.15
        assert plant.lock_engaged("e")


@pytest.mark.parametrize("kind", PLANTS)
def test_a_lock_that_jams_stays_closed_and_says_so(kind: str) -> None:
    scene = _scene(kind, faults="[{kind: lock_jammed, unit: f}]")
    with open_simulation(scene, _start(scene)) as simulation:
        plant = simulation.plant
        for unit in "ef":
            plant.set_lock(unit, False)
        plant.step()
        assert (plant.lock_engaged("e"), plant.lock_engaged("f")) == (False, True)
        assert plant.lock_position("f") is LockPosition.CLOSED


@pytest.mark.parametrize("kind", PLANTS)
def test_a_unit_that_does_not_stand_in_its_seat_is_not_assembled(kind: str) -> None:
    scene = _scene(kind)
    start = _start(scene)
    X = start.units["f"]
    off = open_simulation(scene, Placement({**start.units, "f": X @ SE2(-0.01)}, {}))
    with pytest.raises(MsrrError, match="'f' does not stand in its seat at e"), off:
        pass
