"""Plots of a run: repeatable, in three formats."""

from __future__ import annotations

from dataclasses import replace

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import BAD_INPUT
from msrr_bullet.figures.plots import run_plot
from msrr_bullet.figures.plots.run_plot import write_plot
from msrr_bullet.timeline import palette
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.plan import DockStep
from tests.bullet.conftest import with_step


def test_the_plot_shows_belief_on_truth_and_the_clearance(count_pixels, short_log, short_snapshots, tmp_path):
    """Every curve takes more than 100 pixels beyond what a plot without it has, such as its legend."""
    path = write_plot(tmp_path / "plot.png", short_log.header.scene, short_snapshots, "timeout")
    assert count_pixels(path, palette.PATH, 3) > 100
    bare = [
        with_step(replace(s, clearance=None), estimate=None, los=None, twist=None) for s in short_snapshots
    ]
    without = write_plot(tmp_path / "bare.png", short_log.header.scene, bare, "timeout")
    for name in ("BELIEF", "CLEARANCE", "GREEN", "VERMILLION", "PLAN"):
        drawn, legend = (count_pixels(each, getattr(palette, name), 3) for each in (path, without))
        assert drawn - legend > 100, name


@pytest.mark.parametrize("ending", ["pdf", "svg"])
def test_other_formats(short_log, short_snapshots, tmp_path, ending):
    path = write_plot(tmp_path / f"plot.{ending}", short_log.header.scene, short_snapshots[::10])
    assert path.stat().st_size > 10_000
    assert path.read_bytes().startswith({"pdf": b"%PDF", "svg": b"<?xml"}[ending])


def test_a_run_without_pixels_or_long_distance_phase_is_plotted(blind_run, capsys):
    assert run(["plot", str(blind_run)]) == 0
    assert (blind_run / "plot.png").is_file()


def test_what_cannot_be_plotted_is_refused(short_log, tmp_path, short_run, capsys):
    with pytest.raises(MsrrError, match="without a single snapshot"):
        write_plot(tmp_path / "none.png", short_log.header.scene, [])
    assert run(["plot", str(short_run), "--out", str(tmp_path / "plot.docx")]) == BAD_INPUT
    assert ".png" in capsys.readouterr().err
    assert run(["plot", str(tmp_path)]) == BAD_INPUT


def test_curves_that_a_unit_does_not_have_are_left_out(short_log, short_snapshots, tmp_path, monkeypatch):
    """A unit that a base station sends into the open has no port, and its camera shows no target."""
    drawn = []
    monkeypatch.setattr(run_plot, "save", lambda figure, path: drawn.append(figure))
    steps = [replace(s.steps[0], step=None, estimate=None, los=None) for s in short_snapshots[::10]]
    bare = [replace(s, steps=(step,)) for s, step in zip(short_snapshots[::10], steps, strict=True)]
    for snapshots in (short_snapshots[::10], bare):
        write_plot(tmp_path / "plot.png", short_log.header.scene, snapshots)
    whole, few = ({axes.get_ylabel() for axes in figure.axes} for figure in drawn)
    assert {"gap to the port [m]", "lateral [mm]", "yaw [deg]", "edge angle [deg]"} == whole - few
    assert few >= {"v [m/s]", "w [rad/s]", "clearance [m]"}


def test_units_under_way_at_once_have_curves_of_their_own(short_log, short_snapshots, tmp_path):
    """Two units at once: without a choice the first is shown, and a unit that has no step is refused."""
    scene = short_log.header.scene
    other = replace(short_snapshots[0].steps[0], unit="b", step=DockStep(unit="b", to="a.rear"))
    both = [replace(s, steps=(*s.steps, other)) for s in short_snapshots[::10]]
    first = write_plot(tmp_path / "first.png", scene, both).read_bytes()
    assert first == write_plot(tmp_path / "a.png", scene, both, unit="a").read_bytes()  # repeatable, too
    assert first != write_plot(tmp_path / "b.png", scene, both, unit="b").read_bytes()
    with pytest.raises(MsrrError, match="unit 'c' has no step in this run; units with one: a, b"):
        write_plot(tmp_path / "c.png", scene, both, unit="c")
