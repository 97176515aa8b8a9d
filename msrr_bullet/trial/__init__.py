"""A trial: the loop over physics, sensors and robot, the judge, and the result.

Only the result is imported here; :mod:`msrr_bullet.trial.trial` imports PyBullet.
"""

from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.step_result import StepResult
from msrr_bullet.trial.versions import package_versions

__all__ = ["StepResult", "TrialResult", "package_versions"]
