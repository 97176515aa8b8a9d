"""The environment of a trial: simulation, devices of the units, pairs that are locked together."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import combinations

from msrr_bullet.collision.clearance import Pair
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.plant.plant import Plant
from msrr_bullet.sensors.devices import Devices
from msrr_bullet.simulation.simulation import Simulation, open_simulation
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


@dataclass
class LockedPairs:
    """The units that are locked together: since the start, or by earlier steps.

    Attributes:
        steps: The docks that are closed, as steps of a plan; their locks have to hold from now on.
        pairs: Pairs of units that are locked together, directly or through others: they are one body, and
            their clearance is that of the seated shape.
    """

    steps: list[DockStep] = field(default_factory=list)
    pairs: set[Pair] = field(default_factory=set)

    def add(self, step: DockStep) -> None:
        """Add the pair that ``step`` has docked."""
        self.steps.append(step)
        group = {step.unit, step.target_unit}
        group.update(*(pair for pair in self.pairs if pair & group))
        self.pairs.update(frozenset(pair) for pair in combinations(sorted(group), 2))

    def remove(self, unit: str) -> None:
        """Remove the pair that is held by the lock of a unit, which is about to open it."""
        steps = [step for step in self.steps if step.unit != unit]
        self.steps.clear()
        self.pairs.clear()
        for step in steps:
            self.add(step)

    def opened(self, plant: Plant) -> DockStep | None:
        """Return the first step whose lock no longer holds; None while all hold."""
        return next((step for step in self.steps if not plant.lock_engaged(step.unit)), None)


@dataclass(frozen=True, eq=False)
class Environment:
    """What all steps of one trial share: the true state, the devices, the shapes, and what is locked."""

    simulation: Simulation
    devices: Devices
    clearance: ClearanceModel
    locked: LockedPairs


@contextmanager
def open_environment(scene: Scene, seed: int) -> Iterator[Environment]:
    """Build the environment of a trial of a checked scene, and close it at the end."""
    placement = draw_placement(scene, lambda name: stream(seed, name))
    with open_simulation(scene, placement, draw_as_built(scene, seed)) as simulation:
        clearance = ClearanceModel.from_scene(scene)
        locked = LockedPairs()
        for step in scene.assembled_docks:
            locked.add(step)
        yield Environment(simulation, Devices(simulation, seed), clearance, locked)
