"""The terms of the laws as pure functions, each with its equation, source and correction.

No function here knows of a phase; :mod:`msrr_control.docking` and :mod:`msrr_control.path_following` combine
them.
"""

from msrr_control.feedback.auxiliary import auxiliary_step
from msrr_control.feedback.composite import composite_feedback
from msrr_control.feedback.envelope import enveloped_acceleration
from msrr_control.feedback.sliding import sliding_feedback
from msrr_control.feedback.visibility_cone import edge_angles

__all__ = [
    "auxiliary_step",
    "composite_feedback",
    "edge_angles",
    "enveloped_acceleration",
    "sliding_feedback",
]
