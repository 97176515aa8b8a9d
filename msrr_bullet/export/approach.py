"""The table that plots are drawn from: belief beside truth at each decision."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msrr_bullet.export.table import Row, columns, time
from msrr_bullet.timeline.series import Series
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.specs.scene import Scene

NAME = "approach"
ABOUT = "Belief beside truth at each decision: what `msrr plot` draws, derived from the tables above."
COLUMNS = columns(
    time_s="simulated time",
    unit="the docking unit",
    attempt="counted from 1",
    phase="phase of the docking step",
    true_gap_m="distance of its port from the face of the target's, along the docking axis, in truth",
    true_lateral_m="offset of its port to the left of the docking axis, in truth",
    true_yaw_rad="heading off the docking axis, in truth",
    believed_gap_m="the same, believed",
    believed_lateral_m="the same, believed",
    believed_yaw_rad="the same, believed",
    commanded_v_mps="forward velocity commanded",
    commanded_w_radps="turn rate commanded",
    true_v_mps="forward velocity until the next decision, in truth",
    true_w_radps="turn rate until the next decision, in truth",
    left_rad="angle of the target's left edge",
    right_rad="angle of its right edge",
    seen="1 when both angles were measured in an image",
    clearance_m="smallest distance between two bodies, in truth",
    docking_pair="1 when that is the docking pair's own, which may touch",
    believed_off_path_m="distance of the controlled point from where on the path it should be, believed",
    true_off_path_m="the same, in truth",
    wall="1 while a wall beside an obstacle stands",
)


def rows(scene: Scene, frames: Sequence[Snapshot]) -> Iterator[Row]:
    """Yield a row for each decision."""
    s = Series.of(scene, frames)
    for i, frame in enumerate(frames):
        yield (
            time(frame.stamp_ns),
            frame.step.unit if frame.step else None,
            frame.attempt,
            frame.phase,
            *s.true_port[i].tolist(),
            *s.believed_port[i].tolist(),
            *s.commanded[i].tolist(),
            *s.driven[i].tolist(),
            *s.sight[i].tolist(),
            bool(s.seen[i]),
            float(s.clearance[i]),
            bool(s.docking_pair[i]),
            float(s.off_path[i]),
            float(s.truly_off_path[i]),
            bool(s.avoiding[i]),
        )
