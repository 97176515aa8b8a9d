"""When a filter corrects its state without what the wheels have told: they spin, or an encoder fails."""

from __future__ import annotations

from msrr_perception.estimation.measurement_history import Measurement
from msrr_perception.motion.filter_state import FilterState
from msrr_scenes.messages import NS_PER_S, Detections

#: Number of measurements in a row outside the gate from which on the wheels are doubted, and time for which
#: they are doubted after the last such [ns].
_DOUBTED_AFTER, _DOUBTED_NS = 3, NS_PER_S

#: Longest time since an image that agrees for which the next one corrects a state without the wheels [ns].
#: One that is farther off may be explained wrongly, as by a turn instead of a way: a start anew is better.
_UNTOLD_NS = NS_PER_S // 4


def doubts_wheels(prior: FilterState, measurement: Measurement, rejected: int) -> bool:
    """Return whether a measurement corrects a state without what the wheels have told since the last one.

    ``rejected`` is the number of measurements, this one included, that do not agree with the wheels, since
    the last one of which everything did.
    """
    if isinstance(measurement, Detections) and prior.stamp_ns - prior.last_seen_ns > _UNTOLD_NS:
        return False
    doubted_ns = prior.wheels_doubted_ns
    return rejected >= _DOUBTED_AFTER or (
        doubted_ns is not None and prior.stamp_ns - doubted_ns <= _DOUBTED_NS
    )
