"""The physics alone is that of the trial: the same commands lead to the same place."""

from __future__ import annotations

from collections.abc import Callable

from msrr_bullet.bench.physics_alone import note_commands
from msrr_bullet.profiler import NullProfiler
from msrr_scenes.messages import seconds
from msrr_scenes.specs.scene import Scene


def test_commands_alone_lead_every_body_to_the_same_place(shipped: Callable[..., Scene]) -> None:
    """Up to the first contact of the pins, bit for bit."""
    scene = shipped("close_range", {"perception": "parametric", "time_limit_s": "7"})
    noted = note_commands(scene, 0, NullProfiler())
    assert {method for _, method, _ in noted.commands} == {"begin_dock", "command", "set_lock"}
    assert seconds(noted.ended_ns) == 7.0
    ms_per_s, poses = noted.replay()
    assert ms_per_s > 0.0
    assert poses == noted.poses
    assert abs(poses["a"].x - scene.units["a"].pose.x_m) > 0.1
