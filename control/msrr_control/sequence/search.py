"""The search for a marker that is not in view."""

from __future__ import annotations

import math

from pydantic import Field

from msrr_scenes.specs.spec import Gain, Length, Spec, Speed, Time

#: Shares of the largest turn rate: up to which a unit searches, as fast turns smear the tags, and up to which
#: the heading of the scan turns, so that a unit that lags behind catches up.
_SHARE, _SCAN_SHARE = 0.5, 0.4


class SearchSpec(Spec):
    """How a unit looks for its target.

    Attributes:
        wait_s: Time for which the unit stands still first, as a frame may just be late or lost.
        sweep_deg: Largest half-width of the scan about the bearing at which the target should be.
        k_per_s: Gain of the turn towards the wanted heading.
        creep_mps: Speed of the slow approach that improves a poor first estimate.
        creep_gap_m: Smallest distance to the face for that approach.
        unseen_m: Way by which a unit comes nearer in each attempt, at that speed, to a target that it has
            lost, before it looks around: from nearer its tags are larger.
    """

    wait_s: Time = 0.4
    sweep_deg: float = Field(default=45.0, gt=0.0, le=180.0)
    k_per_s: Gain = 3.0
    creep_mps: Speed = 0.03
    creep_gap_m: Length = 0.25
    unseen_m: Length = 0.1


def scan(elapsed: float, duration: float, spec: SearchSpec, max_w: float) -> tuple[float, float]:
    """Return heading [rad] and turn rate [rad/s] of the scan; headings count from its middle, to the left.

    After a wait the heading is a triangle wave: to the left, through the middle to the right, and back. As
    long a wait before ``elapsed`` [s] reaches ``duration`` [s] both sides have been scanned, alike: where the
    drive, whose largest turn rate is ``max_w`` [rad/s], is too slow for that, the scan is narrower.
    """
    time = max(duration - 2.0 * spec.wait_s, 1e-3)
    # Out, and all the way to the other side.
    sweep = min(math.radians(spec.sweep_deg), _SCAN_SHARE * max_w * time / 3.0)
    rate = 3.0 * sweep / time
    if elapsed <= spec.wait_s or sweep == 0.0:
        return 0.0, 0.0
    turn = math.fmod(rate * (elapsed - spec.wait_s), 4.0 * sweep)
    if turn <= sweep:
        return turn, rate
    if turn <= 3.0 * sweep:
        return 2.0 * sweep - turn, -rate
    return turn - 4.0 * sweep, rate


def turn_rate(angle: float, spec: SearchSpec, max_w: float, rate: float = 0.0) -> float:
    """Return the turn rate [rad/s] towards a heading, up to half of ``max_w``.

    The heading wanted is at ``angle`` to the left of that of the unit [rad], and turns at ``rate`` [rad/s].
    """
    return min(max(spec.k_per_s * angle + rate, -_SHARE * max_w), _SHARE * max_w)
