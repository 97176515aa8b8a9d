"""The search for a marker that is not in view."""

from __future__ import annotations

import math

from pydantic import Field

from msrr_scenes.specs.spec import Gain, Length, Spec, Speed, Time


class SearchSpec(Spec):
    """How a unit looks for its target.

    Attributes:
        wait_s: Time for which the unit stands still first, as a frame may just be late or lost.
        sweep_deg: Half-width of the scan about the bearing at which the target should be.
        k_per_s: Gain of the turn towards the wanted heading.
        creep_mps: Speed of the slow approach that improves a poor first estimate.
        creep_gap_m: Smallest distance to the face for that approach.
    """

    wait_s: Time = 0.4
    sweep_deg: float = Field(default=60.0, gt=0.0, le=180.0)
    k_per_s: Gain = 3.0
    creep_mps: Speed = 0.03
    creep_gap_m: Length = 0.25


def scan_angle(elapsed: float, duration: float, spec: SearchSpec) -> float:
    """Return the heading [rad] of the scan against its middle, counter-clockwise positive.

    The scan is a triangle wave after a wait: to the left, through the middle to the right, and back. When
    ``elapsed`` [s] reaches ``duration`` [s] both sides have been scanned.
    """
    sweep = math.radians(spec.sweep_deg)
    rate = 3.0 * sweep / max(duration - spec.wait_s, 1e-3)  # out, and all the way to the other side
    turn = math.fmod(max(rate * (elapsed - spec.wait_s), 0.0), 4.0 * sweep)
    if turn <= sweep:
        return turn
    if turn <= 3.0 * sweep:
        return 2.0 * sweep - turn
    return turn - 4.0 * sweep


def turn_rate(angle: float, spec: SearchSpec, max_w: float) -> float:
    """Return the turn rate [rad/s] towards a target ``angle`` [rad] to the left, up to half of ``max_w``."""
    return min(max(spec.k_per_s * angle, -0.5 * max_w), 0.5 * max_w)
