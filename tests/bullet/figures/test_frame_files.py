"""Frames with what the robot made of them: drawn where things are, from the log alone."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from msrr_bullet.cli.app import app as cli
from msrr_bullet.cli.exit_codes import BAD_INPUT
from msrr_bullet.figures import frames
from msrr_bullet.figures.canvas import bgr
from msrr_bullet.figures.drawing import DrawingContext
from msrr_bullet.figures.frames import FILM_SIZE, FramesError, write_frames
from msrr_bullet.figures.onboard_frame import draw_onboard
from msrr_bullet.figures.overhead_frame import draw_overhead
from msrr_bullet.figures.perspective import Perspective, bodies
from msrr_bullet.log import read_log
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.camera_views import CameraView, camera_views, exposures
from msrr_bullet.timeline.interpolation import Moments, between
from msrr_bullet.timeline.log_snapshots import snapshots
from msrr_perception.pose.overhead_model import OVERHEAD
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.messages import NS_PER_S


@pytest.fixture(scope="module")
def log(short_run):
    return read_log(short_run)


@pytest.fixture(scope="module")
def moments(log):
    return Moments(snapshots(log))


@pytest.fixture(scope="module")
def stagecraft(log):
    return DrawingContext(log.header.scene, log.header.seed)


@pytest.fixture(scope="module")
def views(log):
    """Every sixth frame of either camera."""
    return list(camera_views(log, exposures(log)[::6]))


def count(image, colour):
    """Count the pixels of about this colour: the middle of a smooth line has hardly ever exactly its own."""
    return int((np.abs(image.astype(int) - bgr(colour)).max(axis=2) <= 40).sum())


def perspective(scene, view, moment):
    if view.exposure.camera == OVERHEAD:
        return Perspective.overhead(scene)
    unit = view.exposure.camera.partition("/")[0]
    return Perspective.onboard(scene, unit, moment.units[unit])


def true_corners(scene, moment):
    """Return the corners in W, (4, 3) [m], of every tag by its id."""
    found = {}
    for unit, X_WU in moment.units.items():
        for slot, tag_id in scene.tag_ids(unit).items():
            X_WT = SE3.from_se2(X_WU) @ scene.geometry(unit).frame(slot)
            found[tag_id] = X_WT.act(tag_corners(scene.tag_size(slot)))
    return found


def test_what_is_drawn_lies_where_the_camera_saw_it(log, moments, views):
    """The truth of the log, carried to the time of exposure and projected, meets the tags in the pixels."""
    scene = log.header.scene
    off = {OVERHEAD: [], "a/onboard": []}
    for view in views:
        moment = moments.at(view.stamp_ns)
        look, corners = perspective(scene, view, moment), true_corners(scene, moment)
        for tag in view.tags:
            if tag.tag_id in corners:
                off[view.exposure.camera] += list(look.pixels(corners[tag.tag_id]) - tag.corners)
    for camera, errors in off.items():
        distance = np.linalg.norm(errors, axis=1)
        assert len(distance) >= 40, camera
        assert np.median(distance) < 0.35, camera
        assert distance.max() < 1.5, camera


def test_read_pixels_are_shown_as_they_are(views, moments, stagecraft):
    view = next(v for v in views if v.exposure.camera == OVERHEAD and v.windows and v.exposure.frame > 0)
    moment = moments.at(view.stamp_ns)
    image = draw_overhead(stagecraft, view, moment, ()).image
    frame, read = view.mosaic()
    same = (image == frame[..., None]).all(axis=2)
    assert same[read].mean() > 0.5  # lines are drawn over the rest
    assert same[~read].mean() < 0.01
    assert 0.0 < read.mean() < 0.2


def test_an_overhead_frame_shows_truth_belief_plan_and_detections(views, moments, stagecraft):
    view = [v for v in views if v.exposure.camera == OVERHEAD and v.tags][5]
    moment = moments.at(view.stamp_ns)
    picture = draw_overhead(stagecraft, view, moment, moments.until(view.stamp_ns))
    for name in ("PATH", "BELIEF", "PLAN", "DETECTION", "WINDOW", "CLEARANCE"):
        assert count(picture.image, getattr(palette, name)) > 20, name
    words = " ".join(picture.title)
    for told in ("two_units, seed 3", "overhead", "assemble", "attempt 1", "mm off"):
        assert told in words


def test_an_onboard_frame_shows_cone_edges_belief_and_detections(log, views, moments, stagecraft):
    view = [v for v in views if v.exposure.camera == "a/onboard" and v.tags][-1]
    picture = draw_onboard(stagecraft, view, moments.at(view.stamp_ns))
    for name in ("SIGHT", "BELIEF", "DETECTION", "WINDOW"):
        assert count(picture.image, getattr(palette, name)) > 20, name
    camera, los = view.camera, log.header.scene.los
    zoom = picture.image.shape[1] / camera.width
    column = round((camera.cx - camera.focal * math.tan(los.outer) + 0.5) * zoom - 0.5)
    upright = np.abs(picture.image[:, column - 1 : column + 2].astype(int) - bgr(palette.PLAN)).max(axis=2)
    assert (upright.min(axis=1) < 40).mean() > 0.95, "the bound of the cone is a line from top to bottom"
    assert "attempt 1" in picture.title[1]
    assert "line of sight seen" in picture.title[2]


def test_a_camera_that_did_not_look_is_drawn_from_truth_alone(views, moments, stagecraft):
    view = next(v for v in views if v.exposure.camera == "a/onboard")
    picture = draw_onboard(stagecraft, CameraView(view.exposure, view.camera), moments.at(view.stamp_ns))
    assert count(picture.image, palette.WINDOW) == 0
    assert np.ptp(picture.image.reshape(-1, 3), axis=0).min() > 100


def test_belief_is_drawn_where_it_is(views, moments, stagecraft):
    """A belief 20 cm off is drawn 20 cm off."""
    view = [v for v in views if v.exposure.camera == OVERHEAD and v.tags][5]
    moment = moments.at(view.stamp_ns)
    wrong = replace(moment, estimate=moment.estimate @ SE2(0.0, 0.2), assembly=None, clearance=None)
    image = draw_overhead(stagecraft, CameraView(view.exposure, view.camera), wrong, ()).image
    ghost = SE3.from_se2(wrong.estimate).act(bodies(stagecraft.scene)["a"].points)
    hull = Perspective.overhead(stagecraft.scene).hull(ghost)
    for x, y in hull:
        near = image[int(y) - 2 : int(y) + 4, int(x) - 2 : int(x) + 4]
        assert (np.abs(near.astype(int) - bgr(palette.BELIEF)).max(axis=2) < 60).any()


def test_frames_sheet_and_film_are_written(log, tmp_path):
    written = write_frames(log, tmp_path / "frames", count=2)
    cameras = [path.name.partition("_0")[0] for path in written.frames]
    assert sorted(cameras) == ["a_onboard"] * 2 + ["overhead"] * 2
    sizes = {cv2.imread(str(path)).shape[1] for path in written.frames}
    assert sizes == {1280}
    assert written.sheet.is_file()
    assert written.film is None
    again = write_frames(log, tmp_path / "again", count=2)
    for a, b in zip((*written.frames, written.sheet), (*again.frames, again.sheet), strict=True):
        assert a.read_bytes() == b.read_bytes()


def test_a_film_lasts_as_long_as_its_run(log, moments, tmp_path, monkeypatch):
    monkeypatch.setattr(frames, "FILM_RATE", 2.0)  # enough to count
    written = write_frames(log, tmp_path, "onboard", count=1, film=True)
    film = cv2.VideoCapture(str(written.film))
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(2.0)
    shown = 0
    while film.grab():
        shown += 1
    assert abs(shown - moments.end_ns / NS_PER_S * 2.0) <= 2.0
    assert film.get(cv2.CAP_PROP_FRAME_WIDTH) == FILM_SIZE[0]


def test_frames_come_at_the_pace_asked_for(log, tmp_path):
    written = write_frames(log, tmp_path, "overhead", every_s=2.0)
    stamps = {e.frame: e.stamp_ns for e in exposures(log) if e.camera == OVERHEAD}
    times = [stamps[int(path.stem.rpartition("_")[2])] / NS_PER_S for path in written.frames]
    assert times == pytest.approx(np.arange(len(times)) * 2.0, abs=0.11)
    assert len(times) >= 3


def test_what_cannot_be_drawn_is_refused(log, blind_run, tmp_path, capsys):
    with pytest.raises(FramesError, match="no frame of any camera"):
        write_frames(read_log(blind_run), tmp_path)
    with pytest.raises(FramesError, match="at least one frame"):
        write_frames(log, tmp_path, every_s=0.0)
    (tmp_path / "file").write_text("")
    with pytest.raises(FramesError, match="cannot be made a folder"):
        write_frames(log, tmp_path / "file", count=1)
    assert cli.run(["frames", str(blind_run)]) == BAD_INPUT
    assert "perception is images" in capsys.readouterr().err


def test_the_command_writes_beside_the_log(short_run, capsys):
    assert cli.run(["frames", str(short_run), "--camera", "onboard", "--count", "1"]) == 0
    assert "1 frames" in capsys.readouterr().out.replace("\n", " ")
    assert (short_run / "frames" / "sheet.png").is_file()


def test_poses_in_between_lie_on_the_way():
    a, b = SE2(1.0, 2.0, 3.0), SE2(1.2, 1.9, -3.1)  # across the wrap of angles
    half = between(a, b, 0.5)
    np.testing.assert_allclose((a.inverse() @ half).log(), 0.5 * (a.inverse() @ b).log(), atol=1e-12)
    for share, end in ((0.0, a), (1.0, b)):
        np.testing.assert_allclose((end.inverse() @ between(a, b, share)).log(), 0.0, atol=1e-12)


def test_a_solid_around_the_camera_is_cut_where_the_view_begins():
    look = Perspective(PinholeCamera.from_hfov(640, 480, 1.2), SE3())
    cube = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    hull = look.hull(cube)
    assert np.isfinite(hull).all()
    assert hull[:, 0].min() < 0.0
    assert hull[:, 0].max() > 640.0
    assert len(look.hull(cube - np.array([0.0, 0.0, 5.0]))) == 0
    (stretch,) = look.line([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(stretch, np.full((2, 2), [look.camera.cx, look.camera.cy]))
