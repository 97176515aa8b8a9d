"""Curves over time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from msrr_bullet.figures.plots import curves
from msrr_bullet.timeline.series import TrialSeries
from msrr_scenes.geometry.se2 import SE2
from tests.bullet.conftest import with_step


@pytest.fixture
def turning(drive):
    """The drive with a unit that starts near 180 deg, jitters about it, and turns to 0."""
    rng = np.random.default_rng(5)
    done = np.linspace(0.0, 1.0, len(drive.snapshots))
    heading = math.pi * np.clip(1.6 - 1.6 * done, 0.0, 1.0) + 0.02 * rng.standard_normal(len(done))
    unit = drive.scene.plan[0].unit
    X_WD = drive.snapshots[0].units["b"] @ drive.scene.geometry("b").dock_frame("rear")
    return [
        with_step(
            replace(s, units={**s.units, unit: X_WD @ SE2(-0.5, 0.0, float(h))}),
            estimate=X_WD @ SE2(-0.5, 0.0, float(h + 0.02 * rng.standard_normal())) if i > 5 else None,
        )
        for i, (s, h) in enumerate(zip(drive.snapshots, heading, strict=True))
    ]


def test_a_heading_around_180_deg_is_a_line_and_no_block(drive, turning):
    """Every passage through 180 deg drew a line over the whole height."""
    series = TrialSeries.of(drive.scene, turning)
    assert (np.abs(np.diff(series.true_port[:, 2])) > 6.0).sum() > 10
    axes = Figure().add_subplot()
    curves.yaw(axes, series)
    truth, believed = (np.asarray(line.get_ydata()) for line in axes.lines[:2])
    for drawn, values in ((truth, series.true_port), (believed, series.believed_port)):
        known = np.isfinite(values[:, 2])
        assert (np.isfinite(drawn) == known).all()
        assert np.abs(np.diff(drawn[known])).max() < 20.0
        off = np.radians(drawn[known]) - values[known, 2]
        assert np.abs(off - 2.0 * math.pi * np.round(off / (2.0 * math.pi))).max() < 1e-9
    assert abs(truth[-1]) < 10.0


def test_each_step_of_a_plan_ends_within_half_a_turn(drive, turning):
    step = drive.scene.plan[0].model_copy(update={"to": "b.left"})
    later = [with_step(s, step=step) for s in turning]
    series = TrialSeries.of(drive.scene, [*turning, *later])
    axes = Figure().add_subplot()
    curves.yaw(axes, series)
    truth = np.asarray(axes.lines[0].get_ydata())
    for end in (len(turning) - 1, 2 * len(turning) - 1):
        assert abs(truth[end]) <= 180.0


def test_the_clearance_names_the_limits_of_judge_and_collision_monitor(drive):
    """The text said "guard", which no other text and no glossary knows."""
    series = TrialSeries.of(drive.scene, drive.snapshots)
    axes = Figure().add_subplot()
    curves.clearance(axes, series, drive.scene)
    limits = "collision monitor slows 50 mm, collision monitor stops 30 mm, judge 20 mm"
    assert axes.get_title(loc="right") == limits
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "smallest clearance of all bodies (truth)"
    ]
    drawn = np.asarray(axes.lines[0].get_ydata())
    assert np.nanmin(drawn) == np.nanmin(series.clearance) > 0.0, "the docking pair is left out"


def test_the_legend_names_no_clearance_where_there_is_none(drive):
    """The plot of a unit that is alone in its arena had the legend of a curve that was not there."""
    series = TrialSeries.of(drive.scene, drive.snapshots)
    axes = Figure().add_subplot()
    curves.clearance(axes, replace(series, clearance=np.full(len(series.time), np.nan)), drive.scene)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["no two bodies that may not touch"]


def test_the_line_of_sight_names_its_limits_above_the_plot(drive):
    """Beside their lines "outer" lay on "field of view"."""
    axes = Figure().add_subplot()
    curves.sight(axes, TrialSeries.of(drive.scene, drive.snapshots), drive.scene)
    assert axes.get_title(loc="right") == "field of view 37.5 deg, outer 30 deg, inner 20 deg"
    assert not axes.texts
    drawn = sorted(abs(line.get_ydata()[0]) for line in axes.lines if len(line.get_ydata()) == 2)
    assert drawn == pytest.approx([20.0, 20.0, 30.0, 30.0, 37.5, 37.5])


def test_limits_of_a_collision_monitor_that_a_scene_does_not_have_are_not_drawn(drive, shipped):
    """The plot of close_range, which has no overhead camera, told of one that slows at 50 mm."""
    axes = Figure().add_subplot()
    curves.clearance(axes, TrialSeries.of(drive.scene, drive.snapshots), shipped("close_range"))
    assert axes.get_title(loc="right") == "judge 20 mm"


def test_a_scale_of_the_clearance_names_values_about_the_largest(drive):
    """Powers of ten alone named 0.1 m and nothing above it, so that 0.7 m was read as 0.15 m."""
    series = TrialSeries.of(drive.scene, drive.snapshots)
    for largest in (0.05, 0.25, 0.35, 0.7, 1.4, 6.0):
        axes = Figure().add_subplot()
        shown = replace(series, clearance=np.full(len(series.time), largest))
        curves.clearance(axes, shown, drive.scene)
        low, high = axes.get_ylim()
        named = [float(tick) for tick in axes.get_yticks() if low <= tick <= high]
        assert max(named) >= largest / 2.5
        assert len(named) >= 3
