"""Time series of a run: the right numbers, and a figure of them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from msrr_bullet.cli.app import app as cli
from msrr_bullet.cli.exit_codes import BAD_INPUT
from msrr_bullet.figures.canvas import bgr
from msrr_bullet.figures.plot import write_plot
from msrr_bullet.figures.summary import write_picture
from msrr_bullet.figures.top_view import extent
from msrr_bullet.log import read_log
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.log_snapshots import snapshots, verdict
from msrr_bullet.timeline.series import Series
from msrr_bullet.timeline.snapshot import planned_paths
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import Action, AssemblyProgress, Phase
from msrr_scenes.specs.plan import DockStep


@pytest.fixture(scope="module")
def log(short_run):
    return read_log(short_run)


@pytest.fixture(scope="module")
def frames(log):
    return snapshots(log)


@pytest.fixture(scope="module")
def series(log, frames):
    return Series.of(log.header.scene, frames)


def count(path, colour):
    image = cv2.imread(str(path)).astype(int)
    return int((np.abs(image - bgr(colour)).max(axis=2) <= 3).sum())


def test_commands_and_tracking_are_those_of_the_log(log, series):
    actions = [action for _, action in log.messages(Action, "/control/*")]
    np.testing.assert_array_equal(series.commanded, [(a.twist.v, a.twist.w) for a in actions])
    assert series.phases == tuple(a.phase for a in actions)
    progress = [p for _, p in log.messages(AssemblyProgress, "/control/*") if p.path > 0]
    off = [np.hypot(p.tip[0] - p.desired[0], p.tip[1] - p.desired[1]) for p in progress]
    np.testing.assert_allclose(series.off_path[np.isfinite(series.off_path)], off, rtol=0.0, atol=1e-12)
    assert series.assembles


def test_belief_and_truth_agree_to_what_the_camera_can_tell(series):
    for name, phases in (("from above", (Phase.ASSEMBLE,)), ("by sight", (Phase.DOCK,))):
        chosen = np.array([p in phases for p in series.phases])
        off = (series.believed_port - series.true_port)[chosen]
        off = off[np.isfinite(off).all(axis=1)]
        assert len(off) > 20, name
        assert np.abs(off[:, :2]).max() < 0.01, name
        assert np.degrees(np.abs(off[:, 2]).max()) < 1.5, name
    walked = np.isfinite(series.off_path)
    assert np.abs(series.truly_off_path - series.off_path)[walked].max() < 0.01


def test_the_gap_shrinks_by_what_the_unit_drives(series):
    """Two independent series: the integral of the true velocity is the way."""
    docking = np.array([p is Phase.DOCK for p in series.phases])
    time, gap, v = series.time[docking], series.true_port[docking, 0], series.driven[docking, 0]
    heading = series.true_port[docking, 2]
    driven = float(np.sum((v * np.cos(heading))[:-1] * np.diff(time)))
    assert gap[0] - gap[-1] == pytest.approx(driven, abs=1e-3)
    assert gap[0] == pytest.approx(0.7, abs=0.1)


def test_two_steps_of_a_plan_are_not_joined(log, frames):
    scene = log.header.scene
    later = DockStep(unit="b", to="a.rear")
    half = len(frames) // 2
    both = [*frames[:half], *(replace(f, step=later) for f in frames[half:])]
    series = Series.of(scene, both)
    assert np.flatnonzero(series.new_step).tolist() == [0, half]
    torn = series.torn(series.true_port)
    assert np.isnan(torn[half]).all()
    assert np.isfinite(torn[half - 1]).all()
    assert np.isnan(series.driven[half - 1]).all()


def test_the_plot_shows_belief_on_truth_and_the_clearance(log, frames, tmp_path):
    path = write_plot(tmp_path / "plot.png", log.header.scene, frames, "timeout")
    for name in ("PATH", "BELIEF", "CLEARANCE", "GREEN", "VERMILLION", "PLAN"):
        assert count(path, getattr(palette, name)) > 100, name
    again = write_plot(tmp_path / "again.png", log.header.scene, frames, "timeout")
    assert path.read_bytes() == again.read_bytes()


def test_the_picture_of_a_run_shows_its_plan_in_a_shape_that_fits(log, frames, tmp_path):
    scene = log.header.scene
    image = cv2.imread(str(write_picture(tmp_path / "wide.png", scene, frames)))
    assert count(tmp_path / "wide.png", palette.PLAN) > 50
    (x0, x1), (y0, y1) = extent(scene, frames)
    points = np.array([p for path in planned_paths(frames) for p in path.points])
    assert x0 <= points[:, 0].min() <= points[:, 0].max() <= x1
    # Rows without any ink, but for the margins, are room that was not used.
    empty = (image > 250).all(axis=(1, 2))
    assert empty.mean() < 0.12
    assert (y1 - y0) < (x1 - x0)


@pytest.mark.parametrize("ending", ["pdf", "svg"])
def test_other_formats(log, frames, tmp_path, ending):
    path = write_plot(tmp_path / f"plot.{ending}", log.header.scene, frames[::10])
    assert path.stat().st_size > 10_000
    again = write_plot(tmp_path / f"again.{ending}", log.header.scene, frames[::10])
    assert path.read_bytes() == again.read_bytes()


def test_a_run_without_pixels_or_long_phase_is_plotted_too(blind_run, capsys):
    assert cli.run(["plot", str(blind_run)]) == 0
    assert (blind_run / "plot.png").is_file()
    log = read_log(blind_run)
    assert not Series.of(log.header.scene, snapshots(log)).assembles
    assert verdict(log) == "docked"


def test_what_cannot_be_plotted_is_refused(log, tmp_path, short_run, capsys):
    with pytest.raises(MsrrError, match="without a single frame"):
        write_plot(tmp_path / "none.png", log.header.scene, [])
    assert cli.run(["plot", str(short_run), "--out", str(tmp_path / "plot.docx")]) == BAD_INPUT
    assert ".png" in capsys.readouterr().err
    assert cli.run(["plot", str(tmp_path)]) == BAD_INPUT
