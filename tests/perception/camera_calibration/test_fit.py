"""Calibrations of known lenses: from rendered boards, from points with noise, and from photographs."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from msrr_perception.camera_calibration.boards import BoardPoints, Chessboard
from msrr_perception.camera_calibration.fit import (
    BoardView,
    CalibrationError,
    board_residuals,
    calibrate_camera,
)
from msrr_perception.camera_calibration.result import ENTRIES, CameraCalibration
from msrr_perception.photographs.picture_files import picture_files, read_picture
from msrr_scenes.geometry.distortion import COEFFICIENTS, Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.loading.calibration_file import read_calibration, write_calibration

#: What the conftest of this folder makes: a camera, and prints by their names.
Camera, Printed = Any, Callable[[str], Any]


def deviations(found: CameraCalibration, lens: Lens, names: Sequence[str] = ENTRIES) -> dict[str, float]:
    """Return by how many of its standard deviations each free entry is off."""
    camera, distortion = lens.camera, lens.distortion
    truth = dict(zip(ENTRIES[:4], (camera.focal, camera.focal, camera.cx, camera.cy), strict=True))
    truth |= {name: getattr(distortion, name) for name in COEFFICIENTS}
    return {n: (getattr(found.told, n) - truth[n]) / found.sigma[n] for n in names if found.sigma[n]}


def seen(
    lens: Lens, camera: Camera, printed: Printed, count: int, sigma_px: float, seed: int = 4
) -> list[BoardView]:
    """Return the points of a chessboard as a lens shows them, with noise, without any picture."""
    board, rng, views = printed("chessboard"), np.random.default_rng(seed), []
    for i, X_CB in enumerate(replace(camera, lens=lens, seed=seed).poses(board.size, count)):
        shown = lens.distorted(lens.camera.project(X_CB.act(board.points)))
        corners = shown + rng.normal(0.0, sigma_px, shown.shape)
        views.append(BoardView(f"view_{i}", BoardPoints(board.points, corners)))
    return views


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("chessboard", 6),
        pytest.param("chessboard", 20, marks=pytest.mark.nightly),
        pytest.param("charuco", 12, marks=pytest.mark.nightly),
        pytest.param("tags", 12, marks=pytest.mark.nightly),
    ],
)
def test_a_rendered_lens_is_found(camera: Camera, printed: Printed, name: str, count: int) -> None:
    """Within three stated deviations. By chance one of the six entries is off by more in 1 of 60 cases."""
    board = printed(name)
    poses = camera.poses(board.size, count)
    pictures = [camera.photograph(board.pixels, board.pixel, X_CB) for X_CB in poses]
    frame = camera.lens.camera

    def calibrated(lens: Lens | None) -> CameraCalibration:
        found = [board.board.find(pixels, lens) for pixels in pictures]
        views = [BoardView(str(i), points) for i, points in enumerate(found) if points is not None]
        assert len(views) == count
        return calibrate_camera(views, frame.width, frame.height, 2)

    result = calibrated(None)
    if board.board.uses_lens:
        result = calibrated(result.told.lens(frame.width, frame.height))
    off = deviations(result, camera.lens)
    print(f"{name}: {count} pictures: focal length ± {result.sigma['fx_px']:.2f} px")
    assert len(off) == 6
    assert max(map(abs, off.values())) < 3.0, off
    assert result.sigma["fx_px"] < 0.01 * frame.focal


def test_stated_deviations_hold(camera: Camera, printed: Printed) -> None:
    """The sum of squares of six entries, which are correlated, is below 60 but for 1 case in 10^5 or so."""
    off = deviations(calibrate_camera(seen(camera.lens, camera, printed, 8, 0.1), 400, 300, 2), camera.lens)
    assert 0.1 < sum(z * z for z in off.values()) < 60.0


@pytest.mark.nightly
def test_what_a_smaller_model_leaves_out_counts(camera: Camera, printed: Printed) -> None:
    """A lens with p1 and p2, which some of the calibrations leave out: it is the principal point that errs.

    The RMS of 40 normal numbers is above 1.45 in 1 of 10000 cases.
    """
    off = []
    for seed in range(40):
        lens = replace(camera.lens, distortion=Distortion(-0.2, 0.05, 0.002, -0.002))
        found = calibrate_camera(seen(lens, camera, printed, 12, 0.3, seed), 400, 300)
        off.append(deviations(found, lens, ["cx_px", "cy_px"]))
    for name in ("cx_px", "cy_px"):
        rms = float(np.sqrt(np.mean([z[name] ** 2 for z in off])))
        print(f"{name} is off by {rms:.2f} stated deviations, RMS of 40")
        assert rms < 1.45


@pytest.mark.nightly
def test_stated_deviations_hold_on_the_average(camera: Camera, printed: Printed) -> None:
    """Of 40 focal lengths: the RMS of as many normal numbers is outside of 0.7 .. 1.4 in 1 of 200 cases."""
    off = []
    for seed in range(40):
        shown = seen(camera.lens, camera, printed, 8, 0.1, seed)
        off.append(deviations(calibrate_camera(shown, 400, 300, 2), camera.lens)["fx_px"])
    rms = float(np.sqrt(np.mean(np.square(off))))
    print(f"the focal length is off by {rms:.2f} stated deviations, RMS")
    assert 0.7 < rms < 1.4


@pytest.mark.parametrize(
    ("lens", "free"),
    [
        (Distortion(k1=-0.15), 1),
        pytest.param(Distortion(), 0, marks=pytest.mark.nightly),
        pytest.param(Distortion(-0.3, 0.12, 0.01, 0.01), 4, marks=pytest.mark.nightly),
    ],
)
def test_only_coefficients_that_show_are_free(
    camera: Camera, printed: Printed, lens: Distortion, free: int
) -> None:
    """No more than the lens has: with them, what is not known would be worse where no board was."""
    found = calibrate_camera(seen(replace(camera.lens, distortion=lens), camera, printed, 6, 0.05), 400, 300)
    assert found.model.free == free
    assert [m.free for m in found.models] == [0, 1, 2, 4, 5]
    assert found.rms_px == pytest.approx(0.05 * np.sqrt(2.0), rel=0.15)


def test_a_picture_that_contradicts_the_others_is_left_out(camera: Camera, printed: Printed) -> None:
    views = seen(camera.lens, camera, printed, 8, 0.1)
    bent = views[3].points.corners + np.array([3.0, 0.0]) * np.sin(np.arange(35) / 5.0)[:, np.newaxis]
    views[3] = replace(views[3], points=replace(views[3].points, corners=bent))
    found = calibrate_camera(views, 400, 300, 2)
    assert [view.name for view in found.views if not view.used] == ["view_3"]
    assert found.rms_px < 0.2
    assert found.views[3].rms_px > 1.0
    assert max(map(abs, deviations(found, camera.lens).values())) < 4.0


def test_too_little_is_refused(camera: Camera, printed: Printed) -> None:
    views = seen(camera.lens, camera, printed, 4, 0.1)
    with pytest.raises(CalibrationError, match=r"1 picture.* with a board; 3 are the fewest"):
        calibrate_camera(views[:1], 400, 300)
    with pytest.raises(CalibrationError, match="3 free coefficients; expected one of 0, 1, 2, 4, 5"):
        calibrate_camera(views, 400, 300, 3)
    alike = [replace(views[0], name=str(i)) for i in range(4)]
    with pytest.raises(CalibrationError, match=r"4 pictures show the board in 1 place.*move the camera"):
        calibrate_camera(alike, 400, 300, 0)
    moved = [
        replace(v, points=replace(v.points, corners=v.points.corners + 9.0 * i)) for i, v in enumerate(alike)
    ]
    with pytest.raises(CalibrationError, match=r"the boards are parallel, within \d+ degrees; tilt"):
        calibrate_camera(moved, 400, 300, 0)


def test_a_picture_that_was_taken_five_times_counts_once(camera: Camera, printed: Printed) -> None:
    """Copies stood in for the pictures that were held out: the principal point was 13 sigma off."""
    views = seen(camera.lens, camera, printed, 5, 0.1)
    once, copied = (calibrate_camera(v, 400, 300, 1) for v in (views, 5 * views))
    assert copied.model.held_out_px == pytest.approx(once.model.held_out_px, rel=0.01)
    for name in ("fx_px", "cx_px", "cy_px", "k1"):
        assert copied.sigma[name] > 0.9 * once.sigma[name]


def test_pictures_of_one_place_are_held_out_together_where_corners_are_missing(
    camera: Camera, printed: Printed
) -> None:
    """What all pictures of a place share is no noise: each of them alone would make it seem known."""
    whole, partly, rng = list[BoardView](), list[BoardView](), np.random.default_rng(3)
    for view in seen(camera.lens, camera, printed, 6, 0.5):
        for k in range(2):
            corners = view.points.corners + rng.normal(0.0, 0.05, (35, 2))
            shown = np.sort(rng.permutation(35)[: 35 - k])
            whole.append(BoardView(f"{view.name}.{k}", BoardPoints(view.points.points_B, corners)))
            points = BoardPoints(view.points.points_B[shown], corners[shown])
            partly.append(BoardView(f"{view.name}.{k}", points))
    of_whole, of_part = (calibrate_camera(views, 400, 300, 1) for views in (whole, partly))
    for name in ("fx_px", "cx_px", "cy_px", "k1"):
        assert of_part.sigma[name] == pytest.approx(of_whole.sigma[name], rel=0.3), name
    with pytest.raises(CalibrationError, match=r"4 pictures show the board in 2 place"):
        calibrate_camera(partly[:4], 400, 300, 1)


def test_a_board_that_moves_slowly_is_seen_in_many_places(camera: Camera, printed: Printed) -> None:
    """Each picture is within 3 px of the one before: together they still determine a camera."""
    board = printed("chessboard")
    start, end = camera.poses(board.size, 2)
    views = []
    for share in np.linspace(0.0, 0.2, 24):
        turn = cv2.Rodrigues(share * cv2.Rodrigues(end.R @ start.R.T)[0])[0]
        X_CB = SE3(np.asarray(turn, dtype=np.float64) @ start.R, (1.0 - share) * start.p + share * end.p)
        shown = camera.lens.distorted(camera.lens.camera.project(X_CB.act(board.points)))
        views.append(BoardView(f"{share}", BoardPoints(board.points, shown)))
    steps = [np.abs(b.points.corners - a.points.corners).max() for a, b in itertools.pairwise(views)]
    assert max(steps) < 3.0
    assert calibrate_camera(views, 400, 300, 1).told.fx_px == pytest.approx(330.0, rel=0.01)


def test_a_better_lens_that_folds_counts_in_sigma(camera: Camera, printed: Printed) -> None:
    """A lens of equal angles in equal steps is wider than the model: five coefficients fold the picture."""
    board, views, rng = printed("chessboard"), list[BoardView](), np.random.default_rng(1)
    wide = replace(camera, lens=Lens(PinholeCamera(400, 300, 150.0, (0.0, 0.0))), seed=1)
    for i, X_CB in enumerate(wide.poses(board.size, 10)):
        p = X_CB.act(board.points)
        aside = np.hypot(p[:, 0], p[:, 1])
        radius = 199.5 * np.arctan2(aside, p[:, 2]) / aside
        corners = p[:, :2] * radius[:, np.newaxis] + [199.5, 149.5]
        views.append(BoardView(str(i), BoardPoints(board.points, corners + rng.normal(0.0, 0.01, (35, 2)))))
    found = calibrate_camera(views, 400, 300)
    assert found.refused is not None
    assert found.refused.folds
    assert found.refused.held_out_px < found.model.held_out_px
    assert abs(found.told.fx_px - 199.5) < 2.0 * found.sigma["fx_px"]
    assert found.sigma["fx_px"] > 2.0 * found.noise_sigma["fx_px"]


def test_a_sharp_picture_is_kept_beside_sharper_ones(camera: Camera, printed: Printed) -> None:
    views, rng = seen(camera.lens, camera, printed, 8, 0.03), np.random.default_rng(5)
    corners = views[3].points.corners + rng.normal(0.0, 0.12, (35, 2))
    views[3] = replace(views[3], points=replace(views[3].points, corners=corners))
    assert all(view.used for view in calibrate_camera(views, 400, 300, 2).views)


def test_a_camera_of_many_pixels_is_calibrated(camera: Camera, printed: Printed, tmp_path: Path) -> None:
    """The pictures of a small camera, twelve times as large: so is its focal length."""
    views = seen(camera.lens, camera, printed, 8, 0.1)
    large = [replace(v, points=replace(v.points, corners=12.0 * v.points.corners + 5.5)) for v in views]
    small, found = (calibrate_camera(v, *size) for v, size in ((views, (400, 300)), (large, (4800, 3600))))
    assert found.model.free == small.model.free
    assert found.told.fx_px == pytest.approx(12.0 * small.told.fx_px, rel=1e-4)
    write_calibration(tmp_path / "large.yaml", found.told)
    assert read_calibration(tmp_path / "large.yaml") == found.told


def test_what_is_wrong_with_every_lens_is_said(camera: Camera, printed: Printed) -> None:
    views = seen(camera.lens, camera, printed, 4, 0.1)
    with pytest.raises(
        CalibrationError, match=r"do not determine the lens: .* width_px = 40000: .* show the"
    ):
        calibrate_camera(views, 40_000, 300)


@pytest.mark.nightly
def test_photographs_of_a_chessboard(photographs: Path) -> None:
    """The bar: 0.4 px, 0.5 px on halves that were held out, 1 % of the focal length of their authors."""
    board = Chessboard(7, 5, 0.03)
    found = [(f.name, board.find(read_picture(f))) for f in picture_files([photographs / "chessboard"])]
    views = [BoardView(name, points) for name, points in found if points is not None]
    assert len(views) == 17
    whole = calibrate_camera(views, 816, 612)
    assert all(view.used for view in whole.views)
    assert whole.rms_px < 0.4
    assert abs(whole.told.fx_px - 765.0) < 7.65
    assert abs(whole.told.fy_px - 764.18) < 7.65
    rng, worst = np.random.default_rng(3), 0.0
    for _ in range(25):
        order = rng.permutation(17)
        for half, other in ((order[:8], order[8:]), (order[8:], order[:8])):
            told = calibrate_camera([views[i] for i in half], 816, 612).told
            residuals = np.concatenate([board_residuals(views[i], told) for i in other])
            worst = max(worst, float(np.sqrt((residuals**2).sum(axis=1).mean())))
    print(f"{whole.told.fx_px:.1f} px, {whole.rms_px:.3f} px RMS, halves at most {worst:.3f} px")
    assert worst < 0.5
