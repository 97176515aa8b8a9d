"""Units that are locked to the target of a docking unit, and stand close beside the port."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.collision.locked_group import locked_group, neighbour_limits
from msrr_control.docking.law import DockSetup
from msrr_control.sequence.port_view import PortView
from msrr_control.shapes.bodies import SEATED
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.messages import ArenaEstimate, GlobalPose, PoseEstimate
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Distance from its seat, and angle, up to which a neighbour that is seen from above is in its seat, however
#: precise sight is; and up to which it may be if sight is not.
_IN_SEAT_M, _IN_SEAT_RAD = 0.015, math.radians(4.0)
_MOST_OFF_M, _MOST_OFF_RAD = 0.045, math.radians(12.0)

#: Squared Mahalanobis distance that one sight in ten thousand exceeds: chi square, 3 degrees of freedom.
_GATE = 21.1


class CloseNeighbours:
    """The neighbours of a port, and where they stand in its dock frame D.

    A docking unit passes them at some centimetres. It knows itself in D by its own camera, and them by their
    locks: far better than the overhead camera, whose tags were put on by hand, shows how near they are. Once
    its pins are in the holes it can only slide into its seat, and what it sees of itself tells nothing more:
    the holes keep it farther from neighbours in their seats than the limits do. ``limits`` are how near the
    unit may come to each of them, by name, and ``offset`` is the distance of the face of the unit's port
    ahead of its axle [m].
    """

    def __init__(
        self,
        scene: Scene,
        model: ClearanceModel,
        step: DockStep,
        joints: Iterable[DockStep],
        stop_m: float,
        sigmas: float,
    ) -> None:
        """Find the neighbours that the unit has to come nearer to than to other bodies.

        ``joints`` are the other docks that are closed or may close meanwhile, and ``stop_m`` is the clearance
        that is kept from other bodies. The unit may be farther from its seat than it sees by ``sigmas``
        standard deviations.
        """
        joints = tuple(joints)
        limits = neighbour_limits(scene, model, joints, step)
        self.limits: Mapping[str, float] = MappingProxyType(
            {name: limit for name, limit in limits.items() if limit < stop_m}
        )
        group = locked_group(scene, joints, step.target_unit)
        self._scene, self._X_TD = scene, scene.dock_frame(step)
        self._setup, self._sigmas = DockSetup.of(scene, step), sigmas
        self.offset = self._setup.offset
        self._seats = {name: self._X_TD.inverse() @ group[name] for name in self.limits}

    def in_dock_frame(self, arena: ArenaEstimate, by_sight: PoseEstimate) -> ArenaEstimate:
        """Return the unit and the neighbours in D that it could come too near to.

        The arena has poses in W, with that of the target; ``by_sight`` is the pose of the unit in D by its
        own camera. A neighbour that is not in its seat is where it is seen against the target, with the
        errors of both.
        """
        assert arena.target is not None, "a unit that docks has a target"
        X_DW = (arena.target.X_WB @ self._X_TD).inverse()
        own = GlobalPose(arena.own.name, by_sight.stamp_ns, by_sight.X_DU, by_sight.covariance)
        view = PortView.of(by_sight, None, self._setup, by_sight.stamp_ns)
        held = view.gap + self._sigmas * view.sigma_gap <= self._setup.pin_reach
        others = []
        for body in arena.others:
            if body.name not in self.limits:
                continue
            if not self._in_seat(body, arena.target):
                P = X_DW.rotate_covariance(self._overhead.covariance_between(body, arena.target))
                others.append(GlobalPose(body.name, body.stamp_ns, X_DW @ body.X_WB, P))
            elif not held:
                others.append(GlobalPose(body.name, body.stamp_ns, self._seats[body.name], SEATED))
        return ArenaEstimate(by_sight.stamp_ns, own, None, tuple(others), (), by_sight.last_seen_ns)

    def least_gap(self, neighbour: GlobalPose) -> float:
        """Return the smallest gap at which the unit could come too near to a neighbour [m].

        With a smaller one the pins are in the holes, or no unit can be there. The neighbour is one that
        :meth:`in_dock_frame` returns.
        """
        return self._setup.pin_reach if self._seats[neighbour.name] == neighbour.X_WB else 0.0

    @cached_property
    def _overhead(self) -> OverheadModel:
        """What is known of the camera by which neighbours are seen; few are seen so that it matters."""
        return OverheadModel.from_scene(self._scene, ())

    def _in_seat(self, body: GlobalPose, target: GlobalPose) -> bool:
        """Return whether a neighbour that is seen from above is in its seat, as far as sight can tell."""
        X_WN = target.X_WB @ self._X_TD @ self._seats[body.name]
        off = X_WN.inverse() @ body.X_WB
        apart, turned = math.hypot(off.x, off.y), abs(off.yaw)
        if apart < _IN_SEAT_M and turned < _IN_SEAT_RAD:
            return True
        if apart > _MOST_OFF_M or turned > _MOST_OFF_RAD:
            return False
        error = np.array([body.X_WB.x - X_WN.x, body.X_WB.y - X_WN.y, off.yaw])
        play = X_WN.rotate_covariance(SEATED)
        # That of the sight of a neighbour which is in its seat.
        covariance = self._overhead.covariance_between(replace(body, X_WB=X_WN), target) + play
        return float(error @ np.linalg.solve(covariance, error)) < _GATE
