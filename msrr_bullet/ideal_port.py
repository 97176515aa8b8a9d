"""The port mechanism without contact: what the pins and the funnel do to a unit, as plain geometry."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrr_bullet.cam import CAM_REACH, PULL_SLACK, SWITCH_TRAVEL, Cam, PullResult
from msrr_bullet.plug import PLUG_LENGTH
from msrr_scenes.errors import GeometryError
from msrr_scenes.messages import LockPosition
from msrr_scenes.plan import DockStep
from msrr_scenes.se2 import SE2
from msrr_scenes.unit_geometry import UnitGeometry
from msrr_scenes.vehicle import LockSpec


@dataclass(frozen=True, slots=True)
class Capture:
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


class IdealPort:
    """One active port before one passive port: a gate at the mouth, a funnel behind it, and a lock.

    All poses are those of the active port's frame P in the dock frame D of its target: ``x`` is minus the gap
    between the faces.
    """

    def __init__(
        self, step: DockStep, geometry: UnitGeometry, target: UnitGeometry, spec: LockSpec, capture: Capture
    ) -> None:
        """Start open, outside the mouth."""
        self.step = step
        self._spec = spec
        self._capture = capture
        self._length = pin_length(geometry, step.port)
        self._X_UP = geometry.port(step.port)
        self._X_TD = target.dock_frame(step.target_port)
        self._cam = Cam(spec.close_time_s)
        self._inside = False
        self.engaged = False
        self.touching = False
        self.plugged = False
        self._X_DP = SE2(-math.inf)

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
        """Distance of the faces [m]; infinite before the first step."""
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

    def _guide(self, X_DP: SE2) -> SE2:
        tips = X_DP.x + self._length
        if tips < 0.0:
            self._inside = self.touching = False
            return X_DP
        c = self._capture
        if not self._inside:
            if self.touching:
                # Stopped at the mouth: friction keeps it there until it backs out.
                return self._X_DP
            if abs(X_DP.y) > c.lateral_m or abs(X_DP.yaw) > c.yaw_rad:
                self.touching = True
                return SE2(-self._length, X_DP.y, X_DP.yaw)
            self._inside = True
        deepest = -PLUG_LENGTH if self.plugged else 0.0
        x = min(X_DP.x, deepest)
        # The room narrows from the mouth to the bottom, for the yaw down to nothing.
        left = min(max(-x / self._length, 0.0), 1.0)
        room = c.play_m + left * (c.lateral_m - c.play_m)
        y = min(max(X_DP.y, -room), room)
        yaw = min(max(X_DP.yaw, -left * c.yaw_rad), left * c.yaw_rad)
        seated = -x <= SWITCH_TRAVEL
        self.touching = seated or (x, y, yaw) != (X_DP.x, X_DP.y, X_DP.yaw)
        return SE2(x, y, yaw)
