"""The port mechanism without contact: the effect of the pins and the funnel on a unit, as geometry."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from msrr_bullet.plant.lock_actuator import LOCK_REACH
from msrr_bullet.plant.plant import PortMechanism
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.pin_and_hole import PinAndHole
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.vehicle import LockSpec

#: Height of a plug above the bottom of the hole [m]: well beyond the reach of the switch and of the lock.
PLUG_LENGTH = 0.010

#: Distance within which a pin is at the mouth [m]: far more than rounding, far less than the way of a tick.
_AT_MOUTH = 1e-9

#: Deviation up to which a start pose in the funnel is taken to lie in it [m, rad].
_START_TOLERANCE = 1e-5

#: Share of the way from the middle of a mouth to its edge, and yaw error, up to which the pins of the shipped
#: unit do not jam in PyBullet. Those of a mechanism of another size jam at the same share.
_CAPTURE_SHARE, _YAW_RAD = 13.0 / 15.0, math.radians(8.0)

#: A point of a unit that is this close to the plane of a port's face is part of the face [m].
_FACE_DEPTH = 1e-3


@dataclass(frozen=True, slots=True)
class CaptureRange:
    """The idealised funnel.

    Attributes:
        lateral_m: Largest lateral error that is drawn in when the tips of the pins pass the mouth [m].
        yaw_rad: Largest yaw error that is drawn in at the mouth [rad].
        play_m: Lateral play of seated pins [m].
    """

    lateral_m: float
    yaw_rad: float
    play_m: float

    @classmethod
    def of(cls, mechanism: PinAndHole) -> CaptureRange:
        """Return the range in which a pair of ports docks without jamming."""
        return cls(round(_CAPTURE_SHARE * mechanism.mouth, 6), _YAW_RAD, mechanism.play)


def face_half_width(geometry: UnitGeometry, port: str) -> float:
    """Return half the width of the face of a port [m]."""
    X_DU = geometry.dock_frame(port).inverse()
    points = X_DU.act(np.concatenate([solid.points()[:, :2] for solid in geometry.solids]))
    face = points[np.abs(points[:, 0]) <= _FACE_DEPTH]
    if not len(face):
        raise GeometryError(f"{geometry.urdf}: no solid reaches the face of port {port!r}")
    return float(np.abs(face[:, 1]).max())


class KinematicPort(PortMechanism):
    """An active port in front of a passive port: a gate at the mouth, a funnel behind it, and a lock.

    The mouth is as wide as the face of the passive port. It affects only pins that enter from outside, not a
    unit beside or behind the target; an overlap of bodies there is for the judge to notice.

    All poses are those of frame P of the active port in the dock frame D of the target; ``x`` is minus the
    gap between the faces.
    """

    def __init__(
        self,
        step: DockStep,
        geometry: UnitGeometry,
        target: UnitGeometry,
        spec: LockSpec,
        X_TU: SE2,
        switch_travel: float,
    ) -> None:
        """Start with an open lock.

        ``X_TU`` is the start pose of the docking unit in the frame of the target unit; pins that are in the
        funnel at the start are held there. ``switch_travel`` is as for
        :class:`msrr_bullet.plant.plant.PortMechanism`.
        """
        super().__init__(step, spec, switch_travel)
        mechanism = PinAndHole.of(geometry, step.port, target, step.target_port)
        self._capture = CaptureRange.of(mechanism)
        self._length = mechanism.pin_length
        self._X_UP = geometry.port(step.port)
        self._X_TD = target.dock_frame(step.target_port)
        # Of a round body only a line is in the plane of the face.
        pins = max(map(abs, mechanism.pins)) + mechanism.mouth
        self._half_width = max(face_half_width(target, step.target_port), pins)
        self._engaged = False
        self._touching = False
        self.plugged = False
        self._X_DP = self._X_TD.inverse() @ X_TU @ self._X_UP
        self._inside = self._in_funnel(self._X_DP)

    @property
    def engaged(self) -> bool:
        """Whether the lock holds the other unit."""
        return self._engaged

    def constrain(self, X_WU: SE2, X_WT: SE2) -> SE2:
        """Return the pose of the docking unit that the port allows, from the one it would have without it."""
        X_WD = X_WT @ self._X_TD
        if self._engaged:
            return X_WD @ self._X_DP @ self._X_UP.inverse()
        X_DP = X_WD.inverse() @ X_WU @ self._X_UP
        held = self._guide(X_DP)
        self._X_DP = held
        return X_WU if held is X_DP else X_WD @ held @ self._X_UP.inverse()

    @property
    def _gap(self) -> float:
        """Distance between the faces [m]."""
        return -self._X_DP.x

    @property
    def in_reach(self) -> bool:
        """Whether the lock would hold the other unit if it became closed now."""
        return self._inside and self._gap <= LOCK_REACH

    def switches(self) -> tuple[bool, bool]:
        """Return whether the seat switches (left, right) are closed; an ideal port closes both or none."""
        closed = self._inside and self._gap <= self._switch_travel
        return closed, closed

    def pins_touch(self) -> bool:
        """Return whether the pins are stopped at the mouth, guided by the funnel, or seated."""
        return self._touching

    def step(self, dt: float) -> None:
        """Advance the lock actuator by ``dt`` [s]."""
        if self._actuator.step(dt):
            self._catch()

    def pull_test(self) -> bool:
        """Compare the pull with the strength of the lock; a lock that is too weak releases the unit."""
        self._engaged = self._engaged and self._spec.pull_force_n < self._spec.strength_n
        return self._engaged

    def _catch(self) -> None:
        self._engaged = self.in_reach

    def _release(self) -> None:
        self._engaged = False

    def _tips(self, X_DP: SE2) -> SE2:
        """Return the pose of the middle between the tips of the pins in D."""
        return X_DP @ SE2(self._length)

    def _guide(self, X_DP: SE2) -> SE2:
        """Return the pose that mouth and funnel allow, given the pose without them."""
        before, tips = self._tips(self._X_DP), self._tips(X_DP)
        if tips.x < -_AT_MOUTH:
            self._inside = self._touching = False
            return X_DP
        if not self._inside:
            if self._touching:
                # A port that is stopped at the mouth is kept there by friction until it backs out.
                return self._X_DP
            entering = before.x < -_AT_MOUTH and math.cos(X_DP.yaw) > 0.0
            if not entering or abs(tips.y) > self._half_width:
                return X_DP
            if abs(X_DP.y) > self._capture.lateral_m or abs(X_DP.yaw) > self._capture.yaw_rad:
                self._touching = True
                return SE2(X_DP.x - tips.x, X_DP.y, X_DP.yaw)
            self._inside = True
        held = self._centred(X_DP)
        seated = -held.x <= self._switch_travel
        self._touching = seated or held != X_DP
        return held

    def _centred(self, X_DP: SE2) -> SE2:
        """Return the nearest pose inside the funnel, whose room narrows with depth, for the yaw to 0."""
        c = self._capture
        x = min(X_DP.x, -PLUG_LENGTH if self.plugged else 0.0)
        share = min(max(-x / self._length, 0.0), 1.0)
        room = c.play_m + share * (c.lateral_m - c.play_m)
        y = min(max(X_DP.y, -room), room)
        yaw = min(max(X_DP.yaw, -share * c.yaw_rad), share * c.yaw_rad)
        return SE2(x, y, yaw)

    def _in_funnel(self, X_DP: SE2) -> bool:
        """Return whether a port that starts at ``X_DP`` has its pins in the funnel."""
        inside = self._centred(X_DP)
        deviation = (inside.x - X_DP.x, inside.y - X_DP.y, inside.yaw - X_DP.yaw)
        return self._tips(X_DP).x >= 0.0 and max(map(abs, deviation)) < _START_TOLERANCE
