"""Commands that make up for the errors of wheels and track that a unit has found out."""

from __future__ import annotations

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.estimation.estimator import Estimator
from msrr_scenes.messages import Action, Twist


class DriveFeedForward:
    """Turns the velocity that is wanted into the one to command to a drive that goes by nominal wheels."""

    def __init__(self, estimator: Estimator, track: float, enabled: bool = True) -> None:
        """Take what is known of the drive from an estimator; one of a user's own knows nothing.

        ``track`` is that of the drawing [m]. Commands are changed only if it is ``enabled``.
        """
        self._filter = estimator if enabled and isinstance(estimator, CornerEkf) else None
        self._half_track = 0.5 * track

    def apply(self, action: Action) -> Action:
        """Return the action after which the unit moves as wanted, as far as its errors are known."""
        if self._filter is None:
            return action
        errors = self._filter.drive_errors()
        return action.with_twist(self.command(action.twist, *errors)) if any(errors) else action

    def command(self, wanted: Twist, left: float, right: float, track: float) -> Twist:
        """Return the command that moves a drive with these relative errors of radii and track as wanted."""
        across = wanted.w * self._half_track * (1.0 + track)
        v_left, v_right = (wanted.v - across) / (1.0 + left), (wanted.v + across) / (1.0 + right)
        return Twist(0.5 * (v_left + v_right), (v_right - v_left) / (2.0 * self._half_track))
