"""Table of belief beside truth at each decision, from which plots are drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msrr_bullet.export.table import Row, columns, time
from msrr_bullet.timeline.series import TrialSeries
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.specs.scene import Scene

NAME = "approach"
ABOUT = "Belief beside truth at each decision: what `msrr plot` draws, derived from the tables above."
COLUMNS = columns(
    time_s="simulated time",
    unit="name of the docking unit",
    attempt="number of the attempt, from 1",
    phase="phase of the docking step",
    true_gap_m="true distance of the unit's port from the face of the target's, along the docking axis",
    true_lateral_m="true offset of the unit's port to the left of the docking axis",
    true_yaw_rad="true heading relative to the docking axis",
    believed_gap_m="estimate of true_gap_m",
    believed_lateral_m="estimate of true_lateral_m",
    believed_yaw_rad="estimate of true_yaw_rad",
    commanded_v_mps="commanded forward velocity",
    commanded_w_radps="commanded turn rate",
    true_v_mps="true forward velocity until the next decision",
    true_w_radps="true turn rate until the next decision",
    left_rad="angle of the left edge of the target",
    right_rad="angle of the right edge of the target",
    seen="1 when both angles were measured in an image",
    clearance_m="true smallest distance between two bodies",
    docking_pair="1 when that is the distance of the docking pair, which may touch",
    believed_off_path_m="estimated distance of the controlled point from the desired point on the path",
    true_off_path_m="true distance of the controlled point from the desired point on the path",
    wall="1 while a wall beside an obstacle is in force",
)


def rows(scene: Scene, snapshots: Sequence[Snapshot]) -> Iterator[Row]:
    """Yield a row for each decision."""
    series = TrialSeries.of(scene, snapshots)
    for i, snapshot in enumerate(snapshots):
        yield (
            time(snapshot.stamp_ns),
            snapshot.docking_unit,
            snapshot.attempt,
            snapshot.phase,
            *series.true_port[i].tolist(),
            *series.believed_port[i].tolist(),
            *series.commanded[i].tolist(),
            *series.driven[i].tolist(),
            *series.sight[i].tolist(),
            bool(series.seen[i]),
            float(series.clearance[i]),
            bool(series.docking_pair[i]),
            float(series.off_path[i]),
            float(series.true_off_path[i]),
            bool(series.avoiding[i]),
        )
