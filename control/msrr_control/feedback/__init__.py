"""The feedback terms of the laws as pure functions, each with equation, source and correction.

No function here knows of a phase; :mod:`msrr_control.docking` and :mod:`msrr_control.path_following` combine
them.
"""

from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step
from msrr_control.feedback.composite import CompositeGains, composite_feedback
from msrr_control.feedback.envelope import EnvelopeGains, enveloped_acceleration
from msrr_control.feedback.sliding import SlidingGains, sliding_feedback
from msrr_control.feedback.visibility_cone import ConeGains, ConeState, cone_force, cone_step, edge_angles

__all__ = [
    "AuxiliaryGains",
    "CompositeGains",
    "ConeGains",
    "ConeState",
    "EnvelopeGains",
    "SlidingGains",
    "auxiliary_step",
    "composite_feedback",
    "cone_force",
    "cone_step",
    "edge_angles",
    "enveloped_acceleration",
    "sliding_feedback",
]
