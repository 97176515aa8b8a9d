"""The environment of a trial: simulation, devices of the units, pairs that are locked together."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from msrr_bullet.collision.clearance import Pair
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.plant.plant import Plant
from msrr_bullet.sensors.devices import Devices
from msrr_bullet.simulation.simulation import Simulation, open_simulation
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


@dataclass
class LockedPairs:
    """The pairs of units that earlier steps of the plan locked together.

    Attributes:
        pairs: Names of the two units of every locked pair.
        docked_units: Units whose locks have to hold from now on.
    """

    pairs: set[Pair] = field(default_factory=set)
    docked_units: list[str] = field(default_factory=list)

    def add(self, step: DockStep) -> None:
        """Add the pair that ``step`` has docked."""
        self.pairs.add(frozenset({step.unit, step.target_unit}))
        self.docked_units.append(step.unit)

    def hold(self, plant: Plant) -> bool:
        """Return whether the locks of all pairs hold."""
        return all(plant.lock_engaged(unit) for unit in self.docked_units)


@dataclass(frozen=True, eq=False)
class Environment:
    """Everything that the steps of one trial share.

    Attributes:
        simulation: Plant, world and true poses.
        devices: Cameras, encoders and command links.
        clearance: Clearance model with the shapes of all bodies.
        locked: Pairs of units that earlier steps locked together.
    """

    simulation: Simulation
    devices: Devices
    clearance: ClearanceModel
    locked: LockedPairs


@contextmanager
def open_environment(scene: Scene, seed: int, placement: Placement) -> Iterator[Environment]:
    """Build the environment of a trial of ``scene`` with ``seed``, and close it at the end."""
    with open_simulation(scene, placement) as simulation:
        clearance = ClearanceModel.from_scene(scene)
        yield Environment(simulation, Devices(simulation, seed), clearance, LockedPairs())
