"""A trial: the loop over physics, sensors and robot, the judge, and the result.

Only the result is imported here; :mod:`msrr_bullet.trial.trial` imports PyBullet.
"""

from msrr_bullet.trial.result import TrialResult, package_versions

__all__ = ["TrialResult", "package_versions"]
