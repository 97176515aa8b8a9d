"""The port mechanism without contact: what the pins and the funnel do to a unit, as plain geometry."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from msrr_bullet.plant.lock_actuator import CAM_REACH, PULL_SLACK, SWITCH_TRAVEL, LockActuator, PullResult
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.messages import LockPosition
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.vehicle import LockSpec

#: How far a plug reaches up from the bottom of the hole [m]: well over what a switch or the cam forgives.
PLUG_LENGTH = 0.010

#: What counts as being at the mouth [m]: far more than rounding, far less than a tick's motion.
_ROUNDING = 1e-9

#: How far from its seat a unit may stand at first and still be taken for seated [m, rad].
_RESTING = 1e-5

#: What of a unit comes this close to the plane of a port's face is part of that face [m].
_FACE_DEPTH = 1e-3


@dataclass(frozen=True, slots=True)
class CaptureRange:
    """The idealised funnel.

    The defaults are what the shipped unit does in PyBullet: drawn in from up to 13 mm and 8 degrees off, and
    stopped at the mouth from 16 mm on.

    Attributes:
        lateral_m: Largest lateral error that is drawn in when the tips pass the mouth.
        yaw_rad: Largest yaw error that is drawn in there.
        play_m: Lateral play of seated pins.
    """

    lateral_m: float = 0.013
    yaw_rad: float = math.radians(8.0)
    play_m: float = 0.0015


def pin_length(geometry: UnitGeometry, port: str) -> float:
    """Return how far the pins stick out of an active port [m]."""
    X_PU = geometry.frame(f"port_{port}").inverse()
    tips = [
        float((X_PU @ solid.X_UG).p[0] + 0.5 * abs((X_PU @ solid.X_UG).R[0]) @ solid.size)
        for solid in geometry.solids
        if solid.link.startswith("pin_") and solid.kind == "box"
    ]
    if not tips:
        raise GeometryError(f"{geometry.urdf}: no pins made of boxes; the unicycle plant needs their length")
    return max(tips)


def face_half_width(geometry: UnitGeometry, port: str) -> float:
    """Return how far the face of a port reaches to either side of its axis [m]."""
    X_DU = geometry.dock_frame(port).inverse()
    points = X_DU.act(np.concatenate([solid.outline() for solid in geometry.solids]))
    face = points[np.abs(points[:, 0]) <= _FACE_DEPTH]
    if not len(face):
        raise GeometryError(f"{geometry.urdf}: no solid reaches the face of port {port!r}")
    return float(np.abs(face[:, 1]).max())


class KinematicPort:
    """One active port before one passive port: a gate at the mouth, a funnel behind it, and a lock.

    The mouth is the face of the passive port and no wider. It minds only pins that come into it from outside.
    A unit beside it, behind it or on the other side of its target has nothing to do with it; where bodies
    overlap there, the clearance judge sees that.

    All poses are those of the active port's frame P in the dock frame D of its target: ``x`` is minus the gap
    between the faces.
    """

    def __init__(
        self,
        step: DockStep,
        geometry: UnitGeometry,
        target: UnitGeometry,
        spec: LockSpec,
        capture: CaptureRange,
        X_TU: SE2,
    ) -> None:
        """Start open.

        Args:
            step: Which port docks to which.
            geometry: Of the docking unit.
            target: Of the unit docked to.
            spec: Of the lock.
            capture: Of the funnel.
            X_TU: Where the docking unit stands in the frame of the other one; if its pins are in the funnel,
                they are held there.
        """
        self.step = step
        self._spec = spec
        self._capture = capture
        self._length = pin_length(geometry, step.port)
        self._X_UP = geometry.port(step.port)
        self._X_TD = target.dock_frame(step.target_port)
        self._cam = LockActuator(spec.close_time_s)
        self._half_width = face_half_width(target, step.target_port)
        self.engaged = False
        self.touching = False
        self.plugged = False
        self._X_DP = self._X_TD.inverse() @ X_TU @ self._X_UP
        self._inside = self._in_funnel(self._X_DP)

    @property
    def position(self) -> LockPosition:
        """What the cam's encoder says."""
        return self._cam.position

    def constrain(self, X_WU: SE2, X_WT: SE2) -> SE2:
        """Return the pose of the docking unit after the port has had its say.

        Args:
            X_WU: Where the wheels would take the unit.
            X_WT: The unit docked to.
        """
        X_WD = X_WT @ self._X_TD
        if self.engaged:
            return X_WD @ self._X_DP @ self._X_UP.inverse()
        X_DP = X_WD.inverse() @ X_WU @ self._X_UP
        held = self._guide(X_DP)
        self._X_DP = held
        return X_WU if held is X_DP else X_WD @ held @ self._X_UP.inverse()

    @property
    def _gap(self) -> float:
        """Distance of the faces [m]."""
        return -self._X_DP.x

    def switches(self) -> tuple[bool, bool]:
        """State of the two seat switches: both or none, as the idealised port knows no tilt."""
        closed = self._inside and self._gap <= SWITCH_TRAVEL
        return closed, closed

    def command(self, close: bool) -> None:
        """Close the cam, or open it and let go."""
        self._cam.command(close)
        if not close:
            self.engaged = False

    def step_cam(self, dt: float) -> None:
        """Advance the cam by ``dt`` [s]."""
        if self._cam.step(dt):
            self.engaged = self._inside and self._gap <= CAM_REACH

    def pull(self) -> PullResult:
        """Compare the pull with what the lock can hold."""
        force = self._spec.pull_force_n
        if self.engaged and force <= self._spec.strength_n:
            return PullResult(force, 0.0, True)
        self.engaged = False
        return PullResult(force, PULL_SLACK, False)

    def _tips(self, X_DP: SE2) -> SE2:
        """Return the middle between the tips of the pins."""
        return X_DP @ SE2(self._length)

    def _guide(self, X_DP: SE2) -> SE2:
        before, tips = self._tips(self._X_DP), self._tips(X_DP)
        if tips.x < -_ROUNDING:
            self._inside = self.touching = False
            return X_DP
        if not self._inside:
            if self.touching:
                # Stopped at the mouth: friction keeps it there until it backs out.
                return self._X_DP
            entering = before.x < -_ROUNDING and math.cos(X_DP.yaw) > 0.0
            if not entering or abs(tips.y) > self._half_width:
                return X_DP
            if abs(X_DP.y) > self._capture.lateral_m or abs(X_DP.yaw) > self._capture.yaw_rad:
                self.touching = True
                return SE2(X_DP.x - tips.x, X_DP.y, X_DP.yaw)
            self._inside = True
        held = self._centred(X_DP)
        seated = -held.x <= SWITCH_TRAVEL
        self.touching = seated or held != X_DP
        return held

    def _centred(self, X_DP: SE2) -> SE2:
        """Return the pose within the room that the funnel leaves: narrowing with depth, for the yaw to 0."""
        c = self._capture
        x = min(X_DP.x, -PLUG_LENGTH if self.plugged else 0.0)
        left = min(max(-x / self._length, 0.0), 1.0)
        room = c.play_m + left * (c.lateral_m - c.play_m)
        y = min(max(X_DP.y, -room), room)
        yaw = min(max(X_DP.yaw, -left * c.yaw_rad), left * c.yaw_rad)
        return SE2(x, y, yaw)

    def _in_funnel(self, X_DP: SE2) -> bool:
        """Say whether pins that are first seen there are in the funnel."""
        near = self._centred(X_DP)
        off = (near.x - X_DP.x, near.y - X_DP.y, near.yaw - X_DP.yaw)
        return self._tips(X_DP).x >= 0.0 and max(map(abs, off)) < _RESTING
