"""How many iterations the solver of PyBullet does: many only while two units may touch.

Contact with an obstacle, which ends a trial, needs no more than that with the floor.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from itertools import combinations

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.world import BulletWorld

#: Enough for contacts to converge: with 50 iterations a unit that jams at the mouth is pressed in and the
#: target creeps away by millimetres; with 400 the median case differs by less than 0.1 mm from 150.
CONTACT_ITERATIONS = 150

#: Enough for wheels on the floor, which need fewer than 10, and for units that are locked together, which
#: need more the more of them there are.
FREE_ITERATIONS = 30

#: Distance between circles about units below which they may touch before the next look [m].
_NEAR_M = 0.03

#: Time between two looks [s]: two units that meet at the top speed of the shipped drive come 30 mm closer.
_PERIOD_S = 0.05


class SolverEffort:
    """Decides the number of iterations from the distances between the units."""

    def __init__(self, world: BulletWorld) -> None:
        """Begin with the iterations that contact needs."""
        self._world = world
        self._period = max(round(_PERIOD_S * world.scene.physics_hz), 1)
        self._tick = 0
        self._iterations = 0
        self._choose(CONTACT_ITERATIONS)
        # Shapes are built as designed, and that geometry is the same in all trials.
        self._radius = {name: world.scene.geometry(name).circumradius for name in world.units}

    def step(self, awake: Collection[str], groups: Mapping[str, tuple[str, ...]]) -> None:
        """Choose the iterations of the next ticks; called once a tick.

        Units that are locked together, the groups, do not move against each other.
        """
        self._tick += 1
        if self._tick % self._period == 0:
            self._choose(CONTACT_ITERATIONS if self._may_touch(awake, groups) else FREE_ITERATIONS)

    def _choose(self, iterations: int) -> None:
        if iterations != self._iterations:
            self._iterations = iterations
            pybullet.setPhysicsEngineParameter(
                numSolverIterations=iterations, physicsClientId=self._world.client
            )

    def _may_touch(self, awake: Collection[str], groups: Mapping[str, tuple[str, ...]]) -> bool:
        world = self._world
        poses = {name: world.pose(name) for name in world.units}
        for a, b in combinations(poses, 2):
            if (a in awake or b in awake) and b not in groups[a]:
                apart = math.hypot(poses[a].x - poses[b].x, poses[a].y - poses[b].y)
                if apart < self._radius[a] + self._radius[b] + _NEAR_M:
                    return True
        return False
