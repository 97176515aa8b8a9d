"""Studies: thousands of unicycle trials of one phase under any law, and the paper's figures of them."""

from msrr_control.studies.disturbance import Disturbance
from msrr_control.studies.docking_study import CLOSE, CLOSE_HARD, StartSet, StudyResult, run_study
from msrr_control.studies.path_following_study import (
    PathFollowingStartSet,
    PathFollowingStudyResult,
    run_path_following_study,
)

__all__ = [
    "CLOSE",
    "CLOSE_HARD",
    "Disturbance",
    "PathFollowingStartSet",
    "PathFollowingStudyResult",
    "StartSet",
    "StudyResult",
    "run_path_following_study",
    "run_study",
]
