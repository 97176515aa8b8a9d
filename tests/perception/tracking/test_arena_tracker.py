"""Tracks of all bodies: poses of those that stand are given anew only now and then, and say so."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.tracking.arena_tracker import ArenaTracker
from msrr_perception.tracking.body_track import SeenPose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose
from msrr_scenes.specs.scene import Scene

MS = 1_000_000


def seen(name: str, stamp_ns: int, X_WB: SE2) -> SeenPose:
    return SeenPose(GlobalPose(name, stamp_ns, X_WB, 1e-6 * np.eye(3)), 1e-7 * np.eye(3))


@pytest.fixture
def trackers() -> list[ArenaTracker]:
    """Trackers without and with a period, to which one unit stands and another one drives."""
    units = {"b": {"number": 1}, "c": {"number": 2}}
    plan = [{"unit": "b", "to": "c.rear"}]
    scene = Scene.model_validate({"name": "x", "units": units, "cameras": {"overhead": {}}, "plan": plan})
    model = OverheadModel.from_scene(scene, units)
    pair = [ArenaTracker(model), ArenaTracker(model, standing_period_s=0.1)]
    for tracker in pair:
        for k in range(10):
            stamp_ns = (30 + 100 * k) * MS
            tracker.add(seen("b", stamp_ns, SE2(1.0, 0.5, 0.2)))
            tracker.add(seen("c", stamp_ns, SE2(0.02 * k, -0.5, 0.0)))
    return pair


def test_a_pose_holds_for_the_instant_that_it_tells(trackers: list[ArenaTracker]) -> None:
    always, sometimes = trackers
    for stamp_ns in range(930 * MS, 2500 * MS, 20 * MS):
        given = sometimes.poses(stamp_ns)
        assert given["c"].stamp_ns == stamp_ns, "a body that drives is where it is now"
        told_ns = given["b"].stamp_ns
        assert max(930 * MS, stamp_ns - 100 * MS) <= told_ns <= stamp_ns
        for name, pose in given.items():
            same = always.poses(pose.stamp_ns)[name]
            assert pose.X_WB == same.X_WB
            np.testing.assert_array_equal(pose.covariance, same.covariance)


def test_the_pose_of_a_body_that_stands_is_the_same_object_meanwhile(trackers: list[ArenaTracker]) -> None:
    _, tracker = trackers
    given = [tracker.poses(stamp_ns)["b"] for stamp_ns in range(1000 * MS, 2000 * MS, 20 * MS)]
    assert len({id(pose) for pose in given}) == 10
    tracker.add(seen("b", 1990 * MS, SE2(1.0, 0.5, 0.2)))
    assert tracker.poses(1995 * MS)["b"].stamp_ns == 1990 * MS
