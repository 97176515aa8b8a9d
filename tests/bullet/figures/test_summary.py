"""The picture of a trial: complete, repeatable, and not upset by what is missing."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from msrr_bullet.figures.summary import DPI, WIDTH, write_picture
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.camera_views import UNREAD, CameraView
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure, Phase, TagDetection


def read(path):
    return cv2.imread(str(path))[:, :, ::-1].astype(int)


def count(image, colour, tolerance=3):
    wanted = [(colour >> shift) & 255 for shift in (16, 8, 0)]
    return int((np.abs(image - wanted).max(axis=2) <= tolerance).sum())


@pytest.fixture
def view(drive):
    camera = drive.scene.cameras.onboard.pinhole
    window = Window(200, 150, 220, 180)
    pixels = np.full((window.height, window.width), 90, dtype=np.uint8)
    corners = np.array([[300.0, 260.0], [340.0, 262.0], [338.0, 220.0], [298.0, 222.0]])
    exposure = Exposure("a/onboard", 60, drive.frames[60].stamp_ns)
    return CameraView(exposure, camera, [(window, pixels)], [TagDetection(11, corners)])


def test_picture_holds_paths_units_and_curves(drive, tmp_path):
    image = read(write_picture(tmp_path / "run.png", drive.scene, drive.frames, headline="docked"))
    assert image.shape[1] == round(WIDTH * DPI)
    for name in ("PATH", "BELIEF", "GREEN", "VERMILLION", "OBSTACLE"):
        assert count(image, getattr(palette, name)) > 150, name


def test_onboard_view_shows_what_was_read_and_what_was_not(drive, view, tmp_path):
    image = read(write_picture(tmp_path / "run.png", drive.scene, drive.frames, [view] * 5))
    read_pixels, unread = 90 * 0x010101, UNREAD * 0x010101
    assert count(image, unread, 1) > 2 * count(image, read_pixels, 1) > 2000


def test_the_same_trial_gives_the_same_picture(drive, view, tmp_path):
    first = write_picture(tmp_path / "a.png", drive.scene, drive.frames, [view]).read_bytes()
    assert first == write_picture(tmp_path / "b.png", drive.scene, drive.frames, [view]).read_bytes()


def test_what_is_missing_is_left_out(drive, tmp_path):
    bare = [
        replace(frame, estimate=None, los=None, clearance=None, phase=None, step=None, obstacles={})
        for frame in drive.frames[::20]
    ]
    assert write_picture(tmp_path / "bare.png", drive.scene, bare).is_file()
    assert write_picture(tmp_path / "one.png", drive.scene, bare[:1]).is_file()
    with pytest.raises(MsrrError, match="without a single frame"):
        write_picture(tmp_path / "none.png", drive.scene, [])


def test_every_phase_has_a_colour():
    assert palette.PHASE_COLOURS.keys() == set(Phase)


def test_neither_picture_nor_pages_touch_the_state_of_pyplot():
    imports = "import sys, msrr_bullet.figures.summary, msrr_bullet.viewer.replay_page"
    code = f"{imports}; print('matplotlib.pyplot' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == "False"
