"""A finished run as a sequence of snapshots, as camera views and as time series, all read from its log.

Viewer, figures and export show what this package holds, in the colours of
:mod:`msrr_bullet.timeline.palette`. A running trial passes the same snapshots to a viewer.
"""

from msrr_bullet.timeline.interpolation import SnapshotInterpolator
from msrr_bullet.timeline.log_snapshots import read_snapshots, read_verdict
from msrr_bullet.timeline.path_following_series import PathFollowingSeries
from msrr_bullet.timeline.series import TrialSeries
from msrr_bullet.timeline.snapshot import Snapshot, Viewer

__all__ = [
    "PathFollowingSeries",
    "Snapshot",
    "SnapshotInterpolator",
    "TrialSeries",
    "Viewer",
    "read_snapshots",
    "read_verdict",
]
