"""Summary picture of a trial: complete, repeatable, and without what is missing."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from msrr_bullet.figures.plots import summary, top_view
from msrr_bullet.figures.plots.summary import DPI, WIDTH, write_picture
from msrr_bullet.figures.plots.top_view import extent
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.camera_views import UNREAD, CameraView
from msrr_bullet.timeline.snapshot import planned_paths
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure, Phase, TagDetection
from tests.bullet.conftest import with_step


@pytest.fixture
def view(drive):
    lens = drive.scene.cameras.onboard.lens
    window = Window(200, 150, 220, 180)
    pixels = np.full((window.height, window.width), 90, dtype=np.uint8)
    corners = np.array([[300.0, 260.0], [340.0, 262.0], [338.0, 220.0], [298.0, 222.0]])
    exposure = Exposure("a/onboard", 60, drive.snapshots[60].stamp_ns)
    return CameraView(exposure, lens, [(window, pixels)], [TagDetection(11, corners)])


def test_picture_holds_paths_units_curves_and_views(count_pixels, drive, view, tmp_path):
    """Of an onboard view it shows what was read and what was not; the same trial gives the same picture."""
    path, again = (
        write_picture(tmp_path / name, drive.scene, drive.snapshots, [view] * 5, headline="docked")
        for name in ("a.png", "b.png")
    )
    assert path.read_bytes() == again.read_bytes()
    image = cv2.imread(str(path))
    assert image.shape[1] == round(WIDTH * DPI)
    for name in ("PATH", "BELIEF", "GREEN", "VERMILLION", "OBSTACLE"):
        assert count_pixels(image, getattr(palette, name), 3) > 150, name
    read_pixels, unread = 90 * 0x010101, UNREAD * 0x010101
    assert count_pixels(image, unread, 1) > 2 * count_pixels(image, read_pixels, 1) > 2000


def test_what_is_missing_is_left_out(drive, tmp_path):
    bare = [replace(snapshot, steps=(), clearance=None, obstacles={}) for snapshot in drive.snapshots[::20]]
    assert write_picture(tmp_path / "bare.png", drive.scene, bare).is_file()
    assert write_picture(tmp_path / "one.png", drive.scene, bare[:1]).is_file()
    with pytest.raises(MsrrError, match="without a single snapshot"):
        write_picture(tmp_path / "none.png", drive.scene, [])


def test_the_picture_of_a_run_shows_its_plan_in_a_shape_that_fits(
    count_pixels, short_log, short_snapshots, tmp_path
):
    scene = short_log.header.scene
    image = cv2.imread(str(write_picture(tmp_path / "wide.png", scene, short_snapshots)))
    assert count_pixels(tmp_path / "wide.png", palette.PLAN, 3) > 50
    (x0, x1), (y0, y1) = extent(scene, short_snapshots)
    points = np.array([p for path in planned_paths(short_snapshots) for p in path.points])
    assert x0 <= points[:, 0].min() <= points[:, 0].max() <= x1
    # Rows without any ink, but for the margins, are room that was not used.
    empty = (image > 250).all(axis=(1, 2))
    assert empty.mean() < 0.12
    assert (y1 - y0) < (x1 - x0)


@pytest.mark.parametrize(
    "ratio", [0.3, 0.88, 0.95, *(pytest.param(r, marks=pytest.mark.nightly) for r in (0.85, 0.92, 1.5))]
)
def test_no_text_runs_over_the_edge(ratio, drive, tmp_path, monkeypatch):
    """The title of the view from above was cut, and so was the label below it in views of some shapes."""
    figures = []

    class Kept(Figure):
        def savefig(self, *args, **kwargs):
            self.draw_without_rendering()
            figures.append(self)

    monkeypatch.setattr(summary, "Figure", Kept)
    for module in (summary, top_view):
        monkeypatch.setattr(module, "extent", lambda *_: ((-1.0, 1.0), (-ratio, ratio)))
    phases = (Phase.ASSEMBLE, Phase.HAND_OVER, Phase.DOCK, Phase.RETREAT)
    busy = [with_step(s, phase=phases[i % 4]) for i, s in enumerate(drive.snapshots[::4])]
    write_picture(tmp_path / "run.png", drive.scene, busy, headline="docked")
    (figure,) = figures
    texts = [t for axes in figure.axes for t in (axes.title, axes.xaxis.label, axes.yaxis.label)]
    for text in filter(Text.get_text, texts):
        box = text.get_window_extent()
        assert box.x0 >= 0.0, text
        assert box.y0 >= 0.0, text
        assert box.x1 <= figure.bbox.x1, text
        assert box.y1 <= figure.bbox.y1, text
    above, *curves_beside = figure.axes
    assert above.title.get_window_extent().y1 <= figure._suptitle.get_window_extent().y0
    right = min(axes.yaxis.label.get_window_extent().x0 for axes in curves_beside)
    assert above.title.get_window_extent().x1 < right


@pytest.mark.nightly
def test_neither_figures_nor_pages_load_pyplot():
    imports = "import sys, msrr_bullet.figures.plots.summary, msrr_bullet.viewer.replay_page"
    code = f"{imports}; print('matplotlib.pyplot' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == "False"
