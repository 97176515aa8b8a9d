"""The watch of a unit over its own drive: wheels that stand although they are commanded to turn."""

from __future__ import annotations

from dataclasses import replace

from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.messages import (
    Action,
    Belief,
    Conviction,
    FailureReason,
    Phase,
    Twist,
    WheelOdometry,
    seconds,
)

#: Time for which the wheels may stand although they are commanded to turn [s]: far more than the delay of the
#: command link and the lag of a drive.
SEIZED_S = 5.0

#: Speed of the faster wheel at its rim below which a command asks for no motion [m/s], and the way from which
#: on a wheel has turned [m], a few ticks of an encoder: a tenth of what the slowest command leads to.
#: The end of a turn on the spot is commanded with some millimetres per second.
_LEAST_MPS, _LEAST_M = 0.002, 0.001

#: Way that a wheel is commanded while it stands, from which on it has seized [m]: a unit that is held in
#: front of an obstacle is commanded to and fro by some millimetres per second, and gets nowhere.
_ASKED_M = 0.01

#: Phases in which nothing holds the wheels of a healthy unit, and others in which nothing does away from the
#: port; at the port it may press against it, and the phase machine judges what comes of it.
_FREE = frozenset({Phase.ASSEMBLE, Phase.HAND_OVER})
_FREE_AWAY = frozenset({Phase.CALIBRATE, Phase.DOCK, Phase.RETREAT})


class DriveWatch:
    """Compares commands with wheel encoders; ``belief`` is None while nothing shows a seized drive."""

    def __init__(self, geometry: UnitGeometry) -> None:
        """Begin with wheels that were never commanded to turn."""
        self._radius, self._track = geometry.wheel_radius, geometry.track
        self._last: WheelOdometry | None = None
        self._stood: WheelOdometry | None = None  # reading since which the wheels have stood
        self._waited_s = 0.0
        self._is_to_move = False
        self._rims = 0.0, 0.0  # speeds at the rims of both wheels that are commanded now [m/s]
        self._asked = 0.0, 0.0  # ways of both rims that were commanded while the wheels stood [m]
        self._gap: float | None = None  # distance from the port at which the wheels have stood [m]
        self.belief: Belief | None = None

    def restart(self) -> None:
        """Begin anew after a time without readings, in which nothing was commanded."""
        self._last = self._stood = None
        self._waited_s, self._asked = 0.0, (0.0, 0.0)

    def judge(self, action: Action, gap: float | None) -> Action:
        """Return what is commanded until the next decision: the action, or to give up.

        ``gap`` is the distance of the unit from its port [m]; None where it is unknown, or so small that the
        unit may press against the port.
        """
        free = action.phase in _FREE or (gap is not None and action.phase in _FREE_AWAY)
        if gap is None or action.phase in _FREE:
            self._gap = None
        elif self._gap is None or abs(gap - self._gap) > _ASKED_M:
            # It gets on, by what it sees: its encoders stand, not its wheels.
            self._gap, self._waited_s, self._asked = gap, 0.0, (0.0, 0.0)
        v, turn = action.twist.v, 0.5 * self._track * action.twist.w
        self._rims = v - turn, v + turn
        self._is_to_move = free and max(map(abs, self._rims)) > _LEAST_MPS
        if self._waited_s > SEIZED_S and max(map(abs, self._asked)) > _ASKED_M:
            reason = f"the drive has seized: its encoders stood for {SEIZED_S:.0f} s of commands to turn"
            self.belief = Belief(Conviction.GAVE_UP, FailureReason.SEIZED, reason)
        if self.belief is None:
            return action
        return replace(action, phase=Phase.FAILED, twist=Twist(), reason=self.belief.reason)

    def read(self, reading: WheelOdometry) -> None:
        """Take in a reading of the encoders."""
        before, self._last = self._last, reading
        if self._stood is None or before is None or self._way(self._stood, reading) > _LEAST_M:
            self._stood, self._waited_s, self._asked = reading, 0.0, (0.0, 0.0)
        elif self._is_to_move:
            dt = seconds(reading.stamp_ns - before.stamp_ns)
            self._waited_s += dt
            self._asked = self._asked[0] + dt * self._rims[0], self._asked[1] + dt * self._rims[1]

    def _way(self, a: WheelOdometry, b: WheelOdometry) -> float:
        """Return how far the rim of the wheel that turned more has moved between two readings [m]."""
        return self._radius * max(abs(b.left - a.left), abs(b.right - a.right))
