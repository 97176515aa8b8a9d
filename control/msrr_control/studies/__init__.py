"""Studies: thousands of unicycle trials of one phase under any law, and the paper's figures of them."""

from msrr_control.studies.disturbance import Disturbance
from msrr_control.studies.docking_study import StudyResult, run_study
from msrr_control.studies.path_following_study import PathFollowingStudyResult, run_path_following_study

__all__ = ["Disturbance", "PathFollowingStudyResult", "StudyResult", "run_path_following_study", "run_study"]
