"""Tracks of all bodies: poses of those that stand are given anew only now and then, and say so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.tracking.arena_tracker import ArenaTracker
from msrr_perception.tracking.seen_pose import SeenPose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import OVERHEAD, Detections, Exposure, GlobalPose, TagDetection
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


def test_what_one_tracker_has_computed_serves_those_that_were_told_the_same(
    trackers: list[ArenaTracker],
) -> None:
    """A mission has a tracker for each unit; without it eight of them compute every track eight times."""
    for tracker in trackers:
        tracker.reset()
    for k in range(4):
        told = [seen("b", 100 * k * MS, SE2()), seen("c", 100 * k * MS, SE2(0.02 * k, -0.5, 0.0))]
        for tracker in trackers:
            for one in told:
                tracker.add(one)
        always, sometimes = (tracker.poses(100 * k * MS) for tracker in trackers)
        assert {name: sometimes[name] is pose for name, pose in always.items()} == {"b": True, "c": True}


def test_what_a_message_of_the_overhead_camera_shows(trackers: list[ArenaTracker]) -> None:
    """Exact corners give the true poses, with the errors of a data sheet beside those of the corners."""
    tracker, _ = trackers
    model, localizer = tracker.model, tracker.model.localizer()
    noise = np.diag([1e-6, 2e-6, 3e-6])
    noisy, poses = (
        ArenaTracker(replace(model, noise=noise)),
        {"b": SE2(0.3, 0.2, 1.0), "c": SE2(-0.4, 0.0, 2.0)},
    )
    tags = tuple(
        TagDetection(model.tag_of[name], localizer.pixels(model.tags[model.tag_of[name]], X))
        for name, X in poses.items()
    )
    shown = [t.locate(Detections(Exposure(OVERHEAD, 3, 40 * MS), tags, ())) for t in (tracker, noisy)]
    assert [each.stamp_ns for each in shown] == [40 * MS, 40 * MS]
    for plain, more in zip(*(each.poses for each in shown), strict=True):
        np.testing.assert_allclose(plain.pose.X_WB.as_array(), poses[plain.pose.name].as_array(), atol=1e-6)
        np.testing.assert_allclose(more.pose.covariance - plain.pose.covariance, noise, atol=1e-12)
        share = localizer.lasting_share[plain.pose.name]
        assert 0.0 < share < 1.0
        for each in (plain, more):
            by_corners = plain.pose.covariance - model.noise
            np.testing.assert_allclose(each.lasting, share * by_corners, rtol=1e-9, atol=1e-18)
    assert len(shown[0].poses) == 2
    elsewhere = tracker.locate(Detections(Exposure("b/onboard", 3, 40 * MS), tags, ()))
    assert (elsewhere.stamp_ns, elsewhere.poses) == (40 * MS, ())


def test_a_pose_that_is_measured_anew_each_time_has_no_error_that_lasts(trackers: list[ArenaTracker]) -> None:
    pose = GlobalPose("b", 7, SE2(1.0, 0.5, 0.2), 1e-6 * np.eye(3))
    seen_poses = trackers[0].locate(pose)
    (one,) = seen_poses.poses
    assert (seen_poses.stamp_ns, one.pose) == (7, pose)
    np.testing.assert_array_equal(one.lasting, np.zeros((3, 3)))


def test_what_is_known_of_bodies_that_were_seen(trackers: list[ArenaTracker]) -> None:
    for tracker in trackers:
        assert [tracker.knows(name) for name in ("a", "b", "c")] == [False, True, True]
        assert tracker.moving() == {"c"}
        tracker.add(seen("c", 960 * MS, SE2(0.19, -0.5, 0.0)))
        assert (tracker.seen_ns("b"), tracker.seen_ns("c")) == (930 * MS, 960 * MS)
        for name in ("b", "c"):
            latest = tracker.latest(name)
            assert (latest.name, latest.stamp_ns) == (name, tracker.seen_ns(name))
        tracker.reset()
        assert tracker.poses(1000 * MS) == {}
        assert tracker.moving() == set()
        assert not tracker.knows("b")


def test_obstacles_are_those_that_were_seen() -> None:
    posts = {
        name: {"shape": "cylinder", "radius_m": radius, "height_m": 0.2, "tag_id": tag}
        for name, radius, tag in (("near", 0.06, 500), ("wide", 0.09, 501), ("unseen", 0.05, 502))
    }
    units = {"b": {"number": 1}, "c": {"number": 2}}
    plan = [{"unit": "b", "to": "c.rear"}]
    scene = Scene.model_validate(
        {"name": "x", "units": units, "obstacles": posts, "cameras": {"overhead": {}}, "plan": plan}
    )
    tracker = ArenaTracker(OverheadModel.from_scene(scene, units))
    for name, x in (("wide", 0.5), ("b", 0.0), ("near", -0.5)):
        tracker.add(seen(name, 10 * MS, SE2(x, 0.1, 0.2)))
    told = {o.name: o for o in tracker.obstacles(tracker.poses(30 * MS))}
    assert {name: (o.radius, o.X_WB.x) for name, o in told.items()} == {
        "near": (pytest.approx(0.06), -0.5),
        "wide": (pytest.approx(0.09), 0.5),
    }
    for name, obstacle in told.items():
        assert obstacle.stamp_ns == tracker.seen_ns(name) == 10 * MS
        np.testing.assert_array_equal(obstacle.covariance, tracker.poses(30 * MS)[name].covariance)
