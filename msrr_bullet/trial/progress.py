"""What a running trial tells whoever watches it."""

from __future__ import annotations

from dataclasses import dataclass

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Phase


@dataclass(frozen=True, slots=True)
class Progress:
    """State of a running trial at one control instant. For people: no part of the robot reads it.

    Attributes:
        time_s: Simulated time.
        phase: Phase of the robot.
        attempt: Counted from 1.
        step: Index in the plan, from 0.
        believed: Estimate X_DU in the dock frame of the target; None while there is none.
        true: True X_DU; None when the step has no target yet.
        reason: Why the phase was entered.
    """

    time_s: float
    phase: Phase
    attempt: int
    step: int = 0
    believed: SE2 | None = None
    true: SE2 | None = None
    reason: str = ""
