"""The bodies around a unit where they are estimated to be, and the clearance of the unit from them."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from copy import copy

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ArenaEstimate, GlobalPose, ObstacleEstimate
from msrr_scenes.messages.coordination import Intent

#: The search of FCL fails where two shapes face each other to within some micrometres (measured: a disc
#: straight in front of a face, 34 mm too far away), and a unit that is driven at an obstacle ends up just so.
#: With the unit moved by this pose it does not fail.
OFFSET = SE2(1.7e-4, 2.3e-4, 3e-4)


class LocalMap:
    """The estimated bodies around one unit at one instant.

    ``reach`` is the largest distance of the footprint of the unit from the origin of U, and ``sigmas`` are
    the standard deviations of the distances between the unit and every other body, if they are near each
    other [m].
    """

    def __init__(
        self,
        model: ClearanceModel,
        arena: ArenaEstimate,
        reaches: Mapping[str, float],
        names: Collection[str],
        intents: Sequence[Intent] = (),
    ) -> None:
        """Collect the estimates.

        ``reaches`` are the largest distances of the footprints from the origins of their bodies [m].
        ``names`` are those of the bodies on the map, and ``intents`` is where those that drive would still
        come.
        """
        self._model = model
        self._own = arena.own.name
        self._reaches = reaches
        self.reach = reaches[self._own]
        others: list[GlobalPose | ObstacleEstimate | None] = [arena.target, *arena.others, *arena.obstacles]
        bodies = [b for b in others if b is not None and b.name in names]
        self._poses = {b.name: b.X_WB for b in bodies}
        self._intended = [(i.unit, SE2(*pose)) for i in intents if i.unit in self._poses for pose in i.poses]
        self.sigmas = {b.name: arena.sigma_between(b, self.reach, reaches[b.name]) for b in bodies}

    def bounds(self, X_WU: SE2, sigmas: float) -> dict[str, float]:
        """Return lower bounds of the clearances of the unit at ``X_WU`` from all bodies [m].

        They are those of circles about the bodies, less so many standard deviations. The body may be where it
        is known to be or where it would still come.
        """
        bounds: dict[str, float] = {}
        for name, X_WB in (*self._poses.items(), *self._intended):
            bound = self._centre_distance(X_WU, name, X_WB) - self.reach - sigmas * self.sigmas[name]
            bounds[name] = min(bounds.get(name, math.inf), bound)
        return bounds

    def only(self, names: Collection[str]) -> LocalMap:
        """Return the map of some of the bodies."""
        part = copy(self)
        part._poses = {name: X_WB for name, X_WB in self._poses.items() if name in names}
        part._intended = [(name, X_WB) for name, X_WB in self._intended if name in names]
        part.sigmas = {name: sigma for name, sigma in self.sigmas.items() if name in names}
        return part

    def uncertainty(self, sigmas: float) -> float:
        """Return so many standard deviations of the distance from the body that is known worst [m]."""
        return sigmas * max(self.sigmas.values())

    def _centre_distance(self, X_WU: SE2, name: str, X_WB: SE2) -> float:
        """Return the distance from the origin of U to the circle about a body [m]."""
        return math.hypot(X_WB.x - X_WU.x, X_WB.y - X_WU.y) - self._reaches[name]

    def clearance(self, X_WU: SE2) -> Clearance | None:
        """Return the smallest clearance of the unit at ``X_WU``; None when there is no other body."""
        nearest = self._model.nearest(self._own, X_WU @ OFFSET, self._poses)
        for name, X_WB in self._intended:
            if nearest is None or self._centre_distance(X_WU, name, X_WB) - self.reach < nearest.distance:
                intended = self._model.nearest(self._own, X_WU @ OFFSET, {name: X_WB})
                if intended is not None and (nearest is None or intended.distance < nearest.distance):
                    nearest = intended
        return nearest

    def least(self, X_WU: SE2, present: Clearance) -> float:
        """Return :meth:`distance` at a pose at which :meth:`clearance` is ``present`` [m]."""
        return present.distance

    def distance(self, X_WU: SE2) -> float:
        """Return the smallest clearance of the unit at ``X_WU`` [m]; infinite when there is no other body."""
        clearance = self.clearance(X_WU)
        return math.inf if clearance is None else clearance.distance
