"""A bench for the port mechanism: unit ``a`` is placed before a port of unit ``b`` and driven by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import pytest

from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.plant.plant import Plant
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene

#: Where the unit docked to stands: in a heading that is no axis of the world.
X_WB = SE2(0.1, -0.2, 0.4)


class Bench:
    """A plant with ``a`` before a port of ``b``."""

    def __init__(self, scene: Scene, plant: Plant) -> None:
        self.scene = scene
        self.plant = plant
        self.dt = 1.0 / scene.physics_hz
        plant.begin_dock(scene.plan[0])

    def X_DP(self) -> SE2:
        """The front port of ``a`` in the dock frame of its target."""
        step = self.scene.plan[0]
        X_WD = self.plant.pose("b") @ self.scene.geometry("b").dock_frame(step.target_port)
        return X_WD.inverse() @ self.plant.pose("a") @ self.scene.geometry("a").port(step.port)

    @property
    def gap(self) -> float:
        """Distance of the faces [m]."""
        return -self.X_DP().x

    def drive(self, v: float, time_s: float, *, until_seated: bool = False) -> None:
        """Drive ``a`` straight at ``v`` for a time, or until both seat switches close."""
        self.plant.command("a", Twist(v, 0.0))
        for k in range(round(time_s / self.dt)):
            self.plant.step()
            if until_seated and k % 8 == 0 and all(self.plant.switches("a")):
                return

    def dock(self, v: float = 0.05, time_s: float = 3.0) -> None:
        """Drive in until seated, then close the lock while pressing."""
        self.drive(v, time_s, until_seated=True)
        self.plant.set_lock("a", True)
        self.drive(v, self.scene.lock.close_time_s + 0.1)
        self.plant.command("a", Twist())


def make_scene(port: str = "rear", **keys: Any) -> Scene:
    """A scene of two units, ``a`` docking to ``b``; ``keys`` are top-level keys of the scene."""
    return Scene.model_validate(
        {
            "name": "bench",
            "units": {"a": {"number": 1}, "b": {"number": 2}},
            "plan": [{"unit": "a", "to": f"b.{port}"}],
            **keys,
        }
    )


def place(scene: Scene, X_DP: SE2) -> Placement:
    """Place ``a`` so that its front port stands at ``X_DP`` in the dock frame of its target."""
    step = scene.plan[0]
    X_WD = X_WB @ scene.geometry("b").dock_frame(step.target_port)
    X_WA = X_WD @ X_DP @ scene.geometry("a").port(step.port).inverse()
    return Placement({"a": X_WA, "b": X_WB}, {})


@contextmanager
def open_bench(kind: str, X_DP: SE2, port: str = "rear", **keys: Any) -> Iterator[Bench]:
    """Set up a plant of a kind (``bullet`` or ``unicycle``) and close it afterwards."""
    scene = make_scene(port, **keys)
    placement = place(scene, X_DP)
    if kind == "bullet":
        with BulletWorld(scene, placement) as world:
            yield Bench(scene, BulletPlant(world))
    else:
        yield Bench(scene, KinematicPlant(scene, placement))


@pytest.fixture(scope="session")
def two_units() -> Callable[..., Scene]:
    return make_scene


@pytest.fixture(scope="session")
def before_port() -> Callable[..., Placement]:
    return place


@pytest.fixture(scope="session")
def bench() -> Callable[..., AbstractContextManager[Bench]]:
    return open_bench
