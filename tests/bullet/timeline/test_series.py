"""Time series of a trial: the values of the log, and the truth beside them."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.log import read_log
from msrr_bullet.timeline.log_snapshots import read_snapshots
from msrr_bullet.timeline.series import TrialSeries
from msrr_scenes.messages import Action, AssemblyProgress, Phase
from msrr_scenes.specs.plan import DockStep
from tests.bullet.conftest import with_step


@pytest.fixture(scope="module")
def series(short_log, short_snapshots):
    return TrialSeries.of(short_log.header.scene, short_snapshots)


def test_commands_and_tracking_are_those_of_the_log(short_log, series):
    actions = [action for _, action in short_log.messages(Action, "/control/*")]
    np.testing.assert_array_equal(series.commanded, [(a.twist.v, a.twist.w) for a in actions])
    assert series.phases == tuple(a.phase for a in actions)
    progress = [p for _, p in short_log.messages(AssemblyProgress, "/control/*") if p.path > 0]
    off = [np.hypot(p.tip[0] - p.desired[0], p.tip[1] - p.desired[1]) for p in progress]
    np.testing.assert_allclose(series.off_path[np.isfinite(series.off_path)], off, rtol=0.0, atol=1e-12)
    assert series.follows_path


def test_belief_and_truth_agree_to_what_the_camera_can_tell(series):
    for name, phases in (("from above", (Phase.ASSEMBLE,)), ("by sight", (Phase.DOCK,))):
        chosen = np.array([p in phases for p in series.phases])
        off = (series.believed_port - series.true_port)[chosen]
        off = off[np.isfinite(off).all(axis=1)]
        assert len(off) > 20, name
        assert np.abs(off[:, :2]).max() < 0.01, name
        assert np.degrees(np.abs(off[:, 2]).max()) < 1.5, name
    walked = np.isfinite(series.off_path)
    assert np.abs(series.true_off_path - series.off_path)[walked].max() < 0.01


def test_the_gap_shrinks_by_the_driven_distance(series):
    """Two independent series: the integral of the true velocity is the way."""
    docking = np.array([p is Phase.DOCK for p in series.phases])
    time, gap, v = series.time[docking], series.true_port[docking, 0], series.driven[docking, 0]
    heading = series.true_port[docking, 2]
    driven = float(np.sum((v * np.cos(heading))[:-1] * np.diff(time)))
    assert gap[0] - gap[-1] == pytest.approx(driven, abs=1e-3)
    assert gap[0] == pytest.approx(0.7, abs=0.1)


def test_two_steps_of_a_plan_are_not_joined(short_log, short_snapshots):
    scene = short_log.header.scene
    later = DockStep(unit="b", to="a.rear")
    half = len(short_snapshots) // 2
    both = [*short_snapshots[:half], *(with_step(f, step=later) for f in short_snapshots[half:])]
    series = TrialSeries.of(scene, both)
    assert np.flatnonzero(series.new_step).tolist() == [0, half]
    gapped = series.with_gaps(series.true_port)
    assert np.isnan(gapped[half]).all()
    assert np.isfinite(gapped[half - 1]).all()
    assert np.isnan(series.driven[half - 1]).all()


def test_a_run_without_a_long_distance_phase_follows_no_path(blind_run):
    log = read_log(blind_run)
    assert not TrialSeries.of(log.header.scene, read_snapshots(log)).follows_path
