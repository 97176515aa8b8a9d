"""Commands that make up for the errors of wheels: the law of the drive, and what it is worth in the loop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from msrr_bullet.robot.drive_feed_forward import DriveFeedForward
from msrr_bullet.trial.trial import Trial
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.pose.target import TargetModel
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Action, Phase, Twist


def test_a_drive_with_these_errors_moves_as_wanted() -> None:
    rng = np.random.default_rng(0)
    scene = load_scene("close_range", {"as_built": "careful"})
    target = TargetModel.from_scene(scene.told(), scene.docks[0])
    feed_forward = DriveFeedForward(CornerEkf(target, scene.odometry), target.track)
    for _ in range(100):
        v, w = rng.uniform(-0.3, 0.3), rng.uniform(-1.0, 1.0)
        left, right, track = rng.uniform(-0.1, 0.1, 3)
        sent = feed_forward.command(Twist(v, w), left, right, track)
        v_left = (sent.v - 0.5 * sent.w * target.track) * (1.0 + left)
        v_right = (sent.v + 0.5 * sent.w * target.track) * (1.0 + right)
        assert 0.5 * (v_left + v_right) == pytest.approx(v)
        assert (v_right - v_left) / (target.track * (1.0 + track)) == pytest.approx(w)


def test_only_commands_of_a_unit_that_knows_an_error_of_its_drive_change() -> None:
    scene = load_scene("close_range", {"as_built": "careful"})
    target = TargetModel.from_scene(scene.told(), scene.docks[0])
    estimator, action = CornerEkf(target, scene.odometry), Action(0, Phase.DOCK, 1, Twist(0.1, 0.2))
    assert DriveFeedForward(estimator, target.track).apply(action) is action
    known = estimator.prior
    known.mean[:3] = [0.0, 0.02, 0.0]
    estimator.recall(known)
    errors = estimator.drive_errors()
    assert any(errors)
    assert not all(errors)
    feed_forward = DriveFeedForward(estimator, target.track)
    changed = feed_forward.apply(action)
    assert changed == action.with_twist(feed_forward.command(action.twist, *errors)) != action
    assert DriveFeedForward(estimator, target.track, enabled=False).apply(action) is action
    of_a_user: Any = object()
    assert DriveFeedForward(of_a_user, target.track).apply(action) is action


def test_errors_of_the_readings_alone_change_no_command() -> None:
    scene = load_scene("close_range", {"as_built": "perfect", "odometry.scale_error": "0.05"})
    target = TargetModel.from_scene(scene.told(), scene.docks[0])
    estimator = CornerEkf(target, scene.odometry)
    known = estimator.prior
    known.mean[:3] = [0.05, -0.05, 0.0]
    estimator.recall(known)
    assert estimator.drive_errors() == (0.0, 0.0, 0.0)


@pytest.mark.nightly
def test_a_wheel_of_another_size_costs_less_than_without() -> None:
    """One wheel 4 % too large, 3 trials without pixels: the same draws, with and without.

    Of 8 trials the means are 0.6 and 1.6 mm.
    """
    of = {
        "perception": "parametric",
        "as_built.grade": "perfect",
        "as_built.drive.radius_left_percent": "{error: 4, sigma: 2}",
        "odometry.scale_error": "0",
    }
    lateral: dict[str, list[float]] = {}
    for switch in ("true", "false"):
        scene = load_scene("close_range", of | {"control.drive_feed_forward": switch})
        contacts = [Trial(scene, seed).run().steps[0].contact for seed in range(3)]
        lateral[switch] = [contact.lateral_m for contact in contacts if contact is not None]
    assert len(lateral["true"]) == len(lateral["false"]) == 3
    assert np.mean(lateral["true"]) < 0.7 * np.mean(lateral["false"])
