"""Sleep of units that stand still: PyBullet leaves them out of the solver, where most of a tick is spent.

PyBullet does not decide well itself: a motor command, a force or a new constraint does not wake a body, and a
sleeping body that is pushed falls asleep again under the push. So both are decided here. Units that are
locked together sleep and wake together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from itertools import combinations

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.unit_body import ROOT
from msrr_bullet.simulation.world import BulletWorld

#: Distance between the circles about two units below which a unit that moves wakes the other one [m]. At half
#: of it a sleeping target was pushed 0.7 mm aside by a docking unit that left a waking one where it stood.
WAKE_DISTANCE_M = 0.1

#: Speeds of the root below which a unit is at rest [m/s], [rad/s]. A gear lets no wheel turn that it holds,
#: but the solver stops before it has converged: units that stand creep by up to 0.1 mm/s.
REST_MPS, REST_RADPS = 5e-4, 2e-3

#: Time for which a unit stays awake after it was roused [s].
AWAKE_S = 0.5

#: Time between two looks at what moves [s]: a unit at the top speed of the shipped drive gains 15 mm.
_PERIOD_S = 0.05

#: Such looks from one to the next at the sleepers themselves, which nothing should have moved.
_WATCH_EVERY = 5


class SleepingUnits:
    """Decides which units sleep; those that are awake are in the order of the scene."""

    def __init__(self, world: BulletWorld) -> None:
        """Begin with all units of ``world`` awake."""
        self._world = world
        hz = world.scene.physics_hz
        self._period, self._awake_ticks = max(round(_PERIOD_S * hz), 1), max(round(AWAKE_S * hz), 1)
        self._tick = 0
        self._roused = dict.fromkeys(world.units, 0)  # tick at which a unit was last roused
        self._asleep: dict[str, None] = {}
        self.awake = tuple(world.units)
        # The units that are locked together with each unit, itself included.
        self._groups: dict[str, tuple[str, ...]] = {name: (name,) for name in world.units}
        # Shapes are built as designed, and that geometry is the same in all trials.
        radius = {name: world.scene.geometry(name).circumradius for name in world.units}
        self._reach = {
            frozenset((a, b)): radius[a] + radius[b] + WAKE_DISTANCE_M
            for a, b in combinations(world.units, 2)
        }

    def is_asleep(self, unit: str) -> bool:
        """Return whether a unit sleeps."""
        return unit in self._asleep

    def join(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Take note of all pairs that are locked together now, and rouse the groups that changed."""
        groups: dict[str, tuple[str, ...]] = {name: (name,) for name in self._groups}
        for a, b in pairs:
            if groups[a] != groups[b]:
                joined = groups[a] + groups[b]
                groups |= dict.fromkeys(joined, joined)
        changed = [name for name, group in groups.items() if set(group) != set(self._groups[name])]
        before, self._groups = self._groups, groups
        for name in changed:
            self.rouse(name)
            for other in before[name]:
                self.rouse(other)

    def rouse(self, unit: str) -> None:
        """Wake a unit and all that are locked to it before they are moved; they stay awake for a while."""
        for name in self._groups[unit]:
            self._roused[name] = self._tick
            if name in self._asleep:
                del self._asleep[name]
                self._world.look(name)
                self._note_awake()
                self._set_state(name, pybullet.ACTIVATION_STATE_DISABLE_SLEEPING)

    def step(self, is_driven: Callable[[str], bool]) -> None:
        """Advance by one tick, before the physics is stepped.

        ``is_driven`` returns whether the drive of a unit is commanded to move or still moves.
        """
        self._tick += 1
        if self._tick % self._period:
            return
        if self._tick % (_WATCH_EVERY * self._period) == 0:
            self.watch()
        # A unit that sleeps is not driven: it would have been roused before.
        driven = {unit: unit not in self._asleep and is_driven(unit) for unit in self._groups}
        for unit, moves in driven.items():
            if moves:
                self.rouse(unit)
        self._wake_the_approached(driven)
        for group in dict.fromkeys(self._groups.values()):
            if group[0] not in self._asleep and all(map(self._may_sleep, group)):
                for name in group:
                    self._asleep[name] = None
                    self._set_state(name, pybullet.ACTIVATION_STATE_ENABLE_SLEEPING)
                    self._set_state(name, pybullet.ACTIVATION_STATE_SLEEP)
                self._note_awake()

    def watch(self) -> None:
        """Rouse the sleepers that something has moved. Until the next call all others stay where they are."""
        for unit in tuple(self._asleep):
            if self._world.look(unit):
                self.rouse(unit)
            else:
                self._world.hold(unit)

    def _wake_the_approached(self, driven: Mapping[str, bool]) -> None:
        poses = {name: self._world.pose(name) for name in self._groups}
        # A unit that is pushed without being driven wakes its neighbours as well.
        movers = [n for n in self._groups if driven[n] or not (n in self._asleep or self._rests(n))]
        for mover in movers:
            X = poses[mover]
            for name, other in poses.items():
                distance = math.hypot(X.x - other.x, X.y - other.y)
                if name != mover and distance < self._reach[frozenset((name, mover))]:
                    self.rouse(name)

    def _note_awake(self) -> None:
        self.awake = tuple(name for name in self._groups if name not in self._asleep)

    def _may_sleep(self, unit: str) -> bool:
        return self._tick - self._roused[unit] >= self._awake_ticks and self._rests(unit)

    def _rests(self, unit: str) -> bool:
        linear, angular = pybullet.getBaseVelocity(
            self._world.units[unit].body, physicsClientId=self._world.client
        )
        return all(abs(v) < REST_MPS for v in linear) and all(abs(w) < REST_RADPS for w in angular)

    def _set_state(self, unit: str, state: int) -> None:
        pybullet.changeDynamics(
            self._world.units[unit].body, ROOT, activationState=state, physicsClientId=self._world.client
        )
