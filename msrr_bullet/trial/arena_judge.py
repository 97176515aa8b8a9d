"""The judge of the arena: collisions, clearances, the locks and the limits of the floor, by the truth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from msrr_bullet.collision.clearance import Clearance, Pair
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.simulation.simulation import Simulation
from msrr_bullet.trial.environment import LockedPairs
from msrr_bullet.trial.judge import Judge
from msrr_bullet.trial.verdict import Verdict
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.outcome import Outcome

#: Margin by which clearances are measured beyond the smallest one that is allowed, which may be 0 [m].
_ROUNDING_M = 1e-6


@dataclass(frozen=True, slots=True)
class Safety:
    """What the judge of the arena found at one control instant.

    Attributes:
        verdict: What ends the trial; None while nothing does.
        units: Units whose doing it is; empty without a verdict.
        nearest: Smallest clearance of all pairs that are not exempt, which the log holds and every display
            shows; None without such a pair, or if it does not matter.
    """

    verdict: Verdict | None
    units: frozenset[str]
    nearest: Clearance | None


_SAFE = Safety(None, frozenset(), None)


class ArenaJudge:
    """Judges all bodies of a trial at every control instant."""

    def __init__(self, simulation: Simulation, clearance: ClearanceModel, locked: LockedPairs) -> None:
        """Begin to judge.

        Pairs that are locked together are one body, and their locks have to hold.
        """
        self._plant, self._clearance, self._locked = simulation.plant, clearance, locked
        scene = simulation.scene
        self._there = {name for name, body in scene.obstacles.items() if body.appears_at_s <= 0.0}
        self._units, self._arena, self._limit = tuple(scene.units), scene.arena, scene.judge.min_clearance_m

    def check(self, poses: Mapping[str, SE2], judges: Iterable[Judge], matters: float = math.inf) -> Safety:
        """Check locks, clearances and the limits of the arena.

        Exempt from the clearances are units that are locked together, and a pair that docks, unless it
        touches beside its port. The poses are the true ones, and the judges those of the steps under way,
        after the decisions of their robots. Below the clearance ``matters`` somebody wants to know it [m];
        the verdict is found in any case.
        """
        appeared = poses.keys() - self._there - set(self._units)
        self._there |= appeared
        opened = self._locked.opened(self._plant)
        if opened is not None:
            said = f"the lock of {opened.unit} holds {opened.to} no longer"
            return Safety(Verdict(Outcome.LOCK_FAILED, said), frozenset({opened.unit}), None)
        docking = {judge.pair: judge for judge in judges if judge.docking}
        exempt = self._locked.pairs | {pair for pair, judge in docking.items() if judge.may_be_near()}
        limit = self._limit
        below = max(matters, limit + _ROUNDING_M)
        nearest = self._clearance.minimum(poses, exempt, below)
        if nearest is not None and nearest.distance <= 0.0:
            (x, y), beside = nearest.point_a, " beside its port" if nearest.pair in docking else ""
            one, other = self._in_order(nearest, docking)
            said = f"{one} touched {other}{beside} at ({x:z.2f}, {y:z.2f}) m"
            if other in appeared:
                said = f"{other} appeared where {one} stood, at ({x:z.2f}, {y:z.2f}) m"
            return Safety(Verdict(Outcome.COLLISION, said), nearest.pair, nearest)
        tested, limits = nearest, None
        while tested is not None and tested.distance < limit:
            limits = _neighbour_limits(docking.values()) if limits is None else limits
            if tested.distance < limits.get(tested.pair, limit):
                one, other = self._in_order(tested, docking)
                said = f"{one} came within {1e3 * tested.distance:z.0f} mm of {other}"
                if other in appeared:
                    said = f"{other} appeared within {1e3 * tested.distance:z.0f} mm of {one}"
                return Safety(Verdict(Outcome.CLEARANCE_VIOLATED, said), tested.pair, nearest)
            exempt.add(tested.pair)
            tested = self._clearance.minimum(poses, exempt, below)
        (x_min, x_max), (y_min, y_max) = self._arena.x_m, self._arena.y_m
        for unit in self._units:
            X_WU = poses[unit]
            if not (x_min <= X_WU.x <= x_max and y_min <= X_WU.y <= y_max):
                said = f"{unit} left the arena at ({X_WU.x:z.2f}, {X_WU.y:z.2f}) m"
                return Safety(Verdict(Outcome.LEFT_ARENA, said), frozenset({unit}), nearest)
        return _SAFE if nearest is None else Safety(None, frozenset(), nearest)

    def _in_order(self, near: Clearance, docking: Mapping[Pair, Judge]) -> list[str]:
        """Return the two bodies: the unit that docks first, then other units, then obstacles."""
        judge, units = docking.get(near.pair), self._units
        first = "" if judge is None else judge.step.unit
        return sorted(near.pair, key=lambda body: (body != first, body not in units, body))


def _neighbour_limits(judges: Iterable[Judge]) -> dict[Pair, float]:
    limits: dict[Pair, float] = {}
    for judge in judges:
        limits |= judge.neighbour_limits()
    return limits
