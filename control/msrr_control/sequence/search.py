"""Looking for a marker that is not in view."""

from __future__ import annotations

import math

from pydantic import Field

from msrr_scenes.specs.spec import NonNegative, Positive, Spec


class SearchSpec(Spec):
    """How a unit looks for its target.

    Attributes:
        wait_s: Stands still first: the frame may just be late or lost.
        sweep_deg: Half-width of the scan to both sides of where the target should be.
        k_per_s: Gain of the turn towards the wanted heading.
        creep_mps: Speed of the creep that improves a poor first estimate.
        creep_gap_m: No creep closer to the face than this.
    """

    wait_s: NonNegative = 0.4
    sweep_deg: float = Field(default=60.0, gt=0.0, le=180.0)
    k_per_s: Positive = 3.0
    creep_mps: Positive = 0.03
    creep_gap_m: Positive = 0.25


def scan_angle(elapsed: float, duration: float, spec: SearchSpec) -> float:
    """Return the heading [rad] of the scan against its middle, counter-clockwise positive.

    A triangle: wait, out to the left, through the middle to the right, back; timed so that both sides have
    been looked at when ``duration`` [s] is over.
    """
    sweep = math.radians(spec.sweep_deg)
    rate = 3.0 * sweep / max(duration - spec.wait_s, 1e-3)  # out, and all the way to the other side
    turn = math.fmod(max(rate * (elapsed - spec.wait_s), 0.0), 4.0 * sweep)
    if turn <= sweep:
        return turn
    if turn <= 3.0 * sweep:
        return 2.0 * sweep - turn
    return turn - 4.0 * sweep


def turn_rate(angle: float, spec: SearchSpec, most: float) -> float:
    """Return the turn rate [rad/s] towards a target ``angle`` [rad] to the left, at most half of ``most``."""
    return min(max(spec.k_per_s * angle, -0.5 * most), 0.5 * most)
