"""The film of a run: its length and its files, and that the scene in it is where it is said to be."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import BAD_INPUT
from msrr_bullet.figures.drawing.canvas import Key
from msrr_bullet.figures.film.body_renderer import BodyRenderer
from msrr_bullet.figures.film.film import MIN_SIZE, SIZE, _fitted, write_film
from msrr_bullet.figures.film.film_file import ENDINGS, FilmError, FilmFile
from msrr_bullet.figures.film.scene_view import MARGIN, SceneView, look_at_all
from msrr_bullet.figures.frames.annotation import AnnotatedFrame
from msrr_bullet.log import read_log
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import NS_PER_S

SMALL = (320, 240)


def pictures_of(path):
    film, pictures = cv2.VideoCapture(str(path)), []
    while (read := film.read())[0]:
        pictures.append(read[1])
    return film.get(cv2.CAP_PROP_FPS), pictures


def test_a_film_lasts_as_long_as_its_run_at_its_speed(short_log, trial, tmp_path):
    shown = ("scene", "overhead", "onboard")
    done = []
    path = write_film(
        short_log, tmp_path / "film.mp4", shown, size=SMALL, speed=50.0, on_picture=lambda *n: done.append(n)
    )
    rate, pictures = pictures_of(path)
    assert rate == 25.0
    assert len(pictures) == math.ceil(trial.end_ns / NS_PER_S * 25.0 / 50.0) + 25  # a second more
    assert done == [(i + 1, len(pictures)) for i in range(len(pictures))]
    assert pictures[0].shape == (SMALL[1], SMALL[0], 3)
    held, change = (np.abs(pictures[-1].astype(int) - pictures[i]) for i in (-12, 2))
    assert held.mean() < 0.2 * change.mean(), "the last instant stays, but for what the compression loses"
    # Something moves in each of the three parts.
    moved = (change > 60).any(axis=2)
    width = SMALL[0] - SMALL[0] // 3
    for part in (moved[:, :width], moved[: SMALL[1] // 2, width:], moved[SMALL[1] // 2 :, width:]):
        assert part.sum() > 20


@pytest.mark.parametrize("ending", [".webm", ".gif"])
def test_other_files_hold_the_pictures_too(tmp_path, ending, capfd):
    pictures = [np.full((64, 96, 3), grey, dtype=np.uint8) for grey in (40, 120, 200)]
    with FilmFile(tmp_path / f"film{ending}", len(pictures)) as film:
        for picture in pictures:
            film.write(picture)
    assert capfd.readouterr() == ("", "")
    rate, read = pictures_of(tmp_path / f"film{ending}")
    assert rate == 25.0
    assert [picture.shape for picture in read] == [(64, 96, 3)] * 3
    assert np.abs(np.array(read).mean(axis=(1, 2, 3)) - [40, 120, 200]).max() < 6.0


def test_a_film_that_fails_leaves_the_older_one_and_no_other_file(tmp_path):
    older = tmp_path / "film.mp4"
    older.write_bytes(b"an older film")

    def interrupted():
        with FilmFile(older, 9) as film:
            film.write(np.zeros((64, 96, 3), dtype=np.uint8))
            assert len(list(tmp_path.iterdir())) == 2
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == [older]
    assert older.read_bytes() == b"an older film"
    with FilmFile(older, 1) as film:
        film.write(np.zeros((64, 96, 3), dtype=np.uint8))
    assert list(tmp_path.iterdir()) == [older]
    assert len(pictures_of(older)[1]) == 1


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_film_that_the_disk_has_no_room_for_is_an_error_and_leaves_no_file(tmp_path, ending, room, capfd):
    random = np.random.default_rng(0)
    pictures = random.integers(0, 255, (40, 240, 320, 3), dtype=np.uint8)

    def film():
        with room(65_536), FilmFile(tmp_path / f"film{ending}", len(pictures)) as film:
            for picture in pictures:
                film.write(picture)

    with pytest.raises(FilmError, match="cannot be written"):
        film()
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")


def test_what_cannot_be_filmed_is_refused(short_log, blind_run, tmp_path, capsys, monkeypatch):
    for path, options, text in (
        ("film.avi", {}, "ends in .mp4, .webm or .gif"),
        ("nowhere/film.mp4", {}, "not a file in an existing folder"),
        ("film.gif", {"speed": 0.1}, "a GIF may have"),
        ("film.mp4", {"size": (641, 480)}, "--size 641x480: give two even numbers"),
        ("film.mp4", {"size": (20, 10)}, "from 320x240"),
        ("film.mp4", {"speed": float("nan")}, "--speed nan: give a number from 0.01"),
        ("film.mp4", {"shown": ()}, "one of scene, overhead and onboard"),
    ):
        with pytest.raises(FilmError, match=text):
            write_film(short_log, tmp_path / path, **options)
    with pytest.raises(FilmError, match="no overhead camera"):
        write_film(read_log(blind_run), tmp_path / "film.mp4", ("overhead",))
    monkeypatch.chdir(tmp_path)  # the folder of this clone may hold runs
    for arguments, text in (
        (["nowhere"], "cannot read the log"),
        ([], "no run is here"),
        ([str(blind_run), "--size", "big"], "expected WIDTHxHEIGHT"),
    ):
        assert run(["film", *arguments]) == BAD_INPUT
        error = capsys.readouterr().err
        assert text in error
        assert error.count("\n") == 1


def test_the_command_films_a_run_that_has_no_pixels(blind_run, capsys):
    assert run(["film", str(blind_run), "--show", "all", "--size", "320x240", "--speed", "40"]) == 0
    assert len(pictures_of(blind_run / "film.mp4")[1]) > 3
    assert "film.mp4" in capsys.readouterr().out


@pytest.mark.parametrize("size", [MIN_SIZE, (640, 360), (600, 240), SIZE], ids=str)
@pytest.mark.parametrize("units", [0, 2, 6, 16, 50])
def test_a_frame_fits_into_its_part_of_the_film_whatever_its_table_has(size, units):
    """A table of many units left no room to the image, and a film of them ended in an error."""
    rows = tuple((k, (f"u{k}", "driving", "docks to u1.rear")) for k in range(units))
    legend = tuple(Key(k, f"what the colour {k} means") for k in range(6))
    image = np.zeros((960, 1280, 3), dtype=np.uint8)
    frame = AnnotatedFrame(image, ("first line", "second line", "third"), "short", legend, rows)
    part = _fitted(frame, *size)
    assert part.shape[1] == size[0]
    assert part.shape[0] <= size[1]
    black = int((part == 0).all(axis=2).any(axis=1).sum())
    assert black >= 0.5 * size[1]


def test_the_camera_sees_everything_and_is_as_near_as_it_can():
    random = np.random.default_rng(5)
    for _ in range(20):
        points = random.normal(size=(40, 3)) * random.uniform(0.1, 3.0, size=3) + random.normal(size=3)
        camera = PinholeCamera.from_hfov(*random.integers(200, 1500, size=2).tolist(), hfov=0.6)
        pixels = look_at_all(points, camera).pixels(points)
        shares = (pixels + 0.5) / [camera.width, camera.height]
        share = np.stack([shares.min(axis=0), 1.0 - shares.max(axis=0)])
        assert share.min() == pytest.approx(MARGIN)
        touched = share[:, int(np.argmin(share.min(axis=0)))]
        assert touched == pytest.approx([MARGIN, MARGIN]), "both opposite edges"


def test_tags_and_bodies_are_where_the_log_has_them(context, trial):
    """The detector reads the tags off the picture, at the places to which their true poses project."""
    view = SceneView(context, trial, 2560, 1440)
    frame = view.draw(trial.end_ns)
    grey = cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY)
    found = {tag.tag_id: tag for tag in PupilDetector().detect(grey, view.perspective.camera.frame)}
    for unit, X_WU in trial.at(trial.end_ns).units.items():
        tag_id = context.scene.tag_ids(unit)["tag_top"]
        square = next(s for X, _, s in context.solids[unit].squares(X_WU) if X.R[2, 2] < -0.5)
        assert np.abs(found[tag_id].corners - view.perspective.pixels(square)).max() < 1.0


def test_a_body_hides_what_is_behind_it_and_nothing_else(context, trial):
    snapshot = trial.at(trial.end_ns)
    perspective = SceneView(context, trial, 640, 360).perspective
    floor = np.full((360, 640, 3), (0, 255, 0), dtype=np.uint8)
    bodies = BodyRenderer(context.scene, context.built)
    alone = bodies.draw(perspective, {}, floor)
    assert (alone == floor).all()
    poses = {**snapshot.units, **snapshot.obstacles}
    changed = (bodies.draw(perspective, poses, floor) != floor).any(axis=2)
    inside = np.zeros((360, 640), dtype=np.uint8)
    for name, X_WB in poses.items():
        plates = [plate for _, plate, _ in context.solids[name].squares(X_WB)]
        hull = perspective.hull(
            np.concatenate([SE3.from_se2(X_WB).act(context.solids[name].points), *plates])
        )
        cv2.fillConvexPoly(inside, np.round(hull).astype(np.int32), 1)
    assert changed.sum() > 1000
    assert not (changed & (cv2.dilate(inside, np.ones((5, 5))) == 0)).any()
    middle = perspective.pixels([[X.x, X.y, 0.05] for X in snapshot.units.values()])
    assert all(changed[round(y), round(x)] for x, y in middle)
