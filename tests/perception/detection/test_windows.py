from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from msrr_perception.detection.windows import (
    DEFAULT_POLICY,
    choose_tags,
    expected_tags,
    fitting_window,
    plan_windows,
    pose_is_known,
)
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.distortion import COEFFICIENTS, Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import PoseEstimate
from tests.perception.conftest import project


def _prediction(X: SE2, sigma: tuple[float, float, float] = (0.001, 0.001, 0.002)) -> PoseEstimate:
    return PoseEstimate(0, X, np.diag(np.square(sigma)), 0)


def _random(seed: int, n: int) -> list[tuple[SE2, tuple[float, float, float]]]:
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(n):
        x = -rng.uniform(0.101, 0.9)
        scale = 10.0 ** rng.uniform(-1.0, 1.0)
        out.append(
            (
                SE2(x, 0.2 * x * rng.uniform(-1, 1), rng.uniform(-0.3, 0.3)),
                (0.002 * scale, 0.002 * scale, 0.004 * scale),
            )
        )
    return out


def test_windows_hold_every_corner_of_the_tags_they_are_for(target: TargetModel) -> None:
    """400 predictions that are wrong by a draw from their own covariance.

    A corner leaves its window when it strays by 4 sigma and more than 6 px besides: odds below 1e-4 a corner
    if the margin were nothing, far below in sum with it.
    """
    rng, frame = np.random.default_rng(0), target.camera.frame
    held = 0
    for k, (X, sigma) in enumerate(_random(1, 400)):
        truth = SE2(*(X.as_array() + rng.normal(0.0, sigma)))
        chosen = choose_tags(target, expected_tags(target, _prediction(X, sigma)), k)
        windows = plan_windows(target.camera.frame, chosen)
        for tag in chosen:
            pixels = project(target, pose_vector(truth), target.corners_D[tag.tag_id])[1]
            if (
                pixels.min() < 0
                or pixels[:, 0].max() > frame.width - 1
                or pixels[:, 1].max() > frame.height - 1
            ):
                continue  # in truth it is not wholly in view
            box = Window.around(pixels, 0.0)
            assert any(w.contains(box) for w in windows)
            held += 1
    assert held > 500


def test_windows_lie_in_the_frame_on_whole_tiles_and_do_not_repeat(target: TargetModel) -> None:
    frame = target.camera.frame
    for k, (X, sigma) in enumerate(_random(2, 200)):
        windows = plan_windows(frame, choose_tags(target, expected_tags(target, _prediction(X, sigma)), k))
        assert len(set(windows)) == len(windows)
        for w in windows:
            assert frame.contains(w)
            assert w.x % 4 == w.y % 4 == 0
            assert w.x_end % 4 == 0
            assert w.y_end % 4 == 0


def test_far_targets_get_one_window_and_near_ones_several_or_turns(target: TargetModel) -> None:
    far = choose_tags(target, expected_tags(target, _prediction(SE2(-0.7, 0.0, 0.0))), 0)
    assert {t.tag_id for t in far} >= set(target.port_tags)
    assert len(plan_windows(target.camera.frame, far)) == 1
    near = expected_tags(target, _prediction(SE2(-0.101, 0.0, 0.0), (1e-4, 1e-4, 1e-3)))
    asked: set[int] = set()
    for turn in range(3):
        chosen = choose_tags(target, near, turn)
        asked |= {t.tag_id for t in chosen}
        area = sum(w.area for w in plan_windows(target.camera.frame, chosen))
        assert area <= DEFAULT_POLICY.budget_px or len(chosen) == 1
    assert asked == set(target.port_tags)


@pytest.mark.parametrize(("x", "share"), [(-0.8, 0.04), (-0.4, 0.07), (-0.2, 0.1), (-0.101, 0.14)])
def test_a_good_prediction_needs_few_pixels(target: TargetModel, x: float, share: float) -> None:
    expected = expected_tags(target, _prediction(SE2(x, 0.0, 0.0), (3e-4, 3e-4, 1e-3)))
    pixels = [
        sum(w.area for w in plan_windows(target.camera.frame, choose_tags(target, expected, k)))
        for k in range(3)
    ]
    assert np.mean(pixels) < share * target.camera.frame.area


def test_uncertainty_and_retries_widen_windows(target: TargetModel) -> None:
    X = SE2(-0.5, 0.0, 0.0)
    sharp, vague = (
        plan_windows(target.camera.frame, expected_tags(target, _prediction(X, (s, s, s))))[0]
        for s in (1e-4, 0.01)
    )
    assert vague.contains(sharp)
    assert vague.area > 1.5 * sharp.area
    wide = plan_windows(target.camera.frame, expected_tags(target, _prediction(X)), widen=3.0)[0]
    assert wide.area > plan_windows(target.camera.frame, expected_tags(target, _prediction(X)))[0].area


def test_only_tags_that_face_the_camera_in_full_view_are_expected(target: TargetModel) -> None:
    seen = {t.tag_id for t in expected_tags(target, _prediction(SE2(-0.7, 0.0, 0.0)))}
    assert seen >= set(target.port_tags)
    behind = SE2(0.9, 0.0, math.pi)  # looking at the unit's other end
    assert not seen & {t.tag_id for t in expected_tags(target, _prediction(behind))}
    assert expected_tags(target, _prediction(SE2(-0.5, 0.0, math.pi))) == ()
    assert expected_tags(target, _prediction(SE2(-9.0, 0.0, 0.0))) == ()  # too small to read
    cut = {t.tag_id for t in expected_tags(target, _prediction(SE2(-0.4, 0.0, 0.58)))}
    assert target.port_tags[2] not in cut or target.port_tags[0] not in cut


def test_neighbours_are_taken_along_only_while_that_is_cheap(target: TargetModel) -> None:
    for x in (-0.85, -0.5, -0.3):
        expected = expected_tags(target, _prediction(SE2(x, 0.0, 0.0)))
        chosen = choose_tags(target, expected, 0)
        area = sum(w.area for w in plan_windows(target.camera.frame, chosen))
        extras = {t.tag_id for t in chosen} - set(target.port_tags)
        assert not extras or area <= DEFAULT_POLICY.extra_px
    far = choose_tags(target, expected_tags(target, _prediction(SE2(-0.85, 0.0, 0.0))), 0)
    assert len(far) == 5


def test_fitting_window_cuts_at_the_border() -> None:
    frame = Window(0, 0, 640, 480)
    assert fitting_window(Window(-5, 470, 20, 30), frame) == Window(0, 468, 16, 12)
    assert fitting_window(Window(101, 102, 1, 1), frame) == Window(100, 100, 4, 4)
    assert fitting_window(Window(700, 0, 10, 10), frame) is None
    part = Window(8, 4, 16, 20)
    assert fitting_window(Window(0, 0, 30, 30), part) == part


def test_a_pose_is_known_when_all_of_it_is() -> None:
    assert pose_is_known(_prediction(SE2(), (0.01, 0.01, 0.01)), 0.02, 0.02)
    assert not pose_is_known(_prediction(SE2(), (0.01, 0.03, 0.01)), 0.02, 0.02)
    assert not pose_is_known(_prediction(SE2(), (0.01, 0.01, 0.03)), 0.02, 0.02)


@pytest.mark.parametrize("coefficients", [{"k1": -0.2, "k2": 0.04, "p1": 0.002}, {"k1": 0.2, "k2": -0.03}])
def test_behind_a_lens_tags_are_expected_where_the_frame_shows_them(
    target: TargetModel, coefficients: dict[str, float]
) -> None:
    """Of 400 poses, also askew: the tags that are in the frame as a whole, at their pixels, and no others."""
    camera = PinholeCamera(640, 480, 417.0, (12.0, -7.0))
    behind = replace(target, lens=Lens(camera, Distortion(**coefficients, aspect=1.03)))
    sharp = replace(target, lens=Lens(camera))
    facing = replace(target, lens=Lens(PinholeCamera(4000, 4000, 417.0)))  # it sees all that face it
    K, k = camera.matrix(), np.array([coefficients.get(key, 0.0) for key in COEFFICIENTS])
    K[1, 1] *= 1.03
    rng, differ = np.random.default_rng(6), 0
    for _ in range(400):
        X = SE2(-rng.uniform(0.2, 0.6), rng.uniform(-0.1, 0.1), rng.uniform(-0.8, 0.8))
        expected = {tag.tag_id: tag.pixels for tag in expected_tags(behind, _prediction(X))}
        differ += expected.keys() != {tag.tag_id for tag in expected_tags(sharp, _prediction(X))}
        for tag in expected_tags(facing, _prediction(X)):
            p_C = project(target, pose_vector(X), target.corners_D[tag.tag_id])[0]
            pixels = cv2.projectPoints(p_C, np.zeros(3), np.zeros(3), K, k)[0][:, 0]
            # Beyond the fold of the lens, which is far outside the frame, OpenCV's pixels mean nothing.
            inside = np.abs(p_C[:, :2] / p_C[:, 2:]).max() < 1.2 and camera.contains(pixels).all()
            assert (tag.tag_id in expected) == inside
            if inside:
                np.testing.assert_allclose(expected[tag.tag_id], pixels, atol=1e-6)
    assert differ > 20  # or the lens would make no difference here
