"""The times of frames: how far a robot may have moved between them, and times that cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.figures.frames.stills import draw_stills
from msrr_bullet.log import read_log
from msrr_bullet.recordings.perceiver import PerceivedInstant
from msrr_bullet.recordings.recording import RecordingError
from msrr_bullet.recordings.run import Options, perceive
from msrr_bullet.timeline.camera_views import read_exposures
from msrr_bullet.timeline.log_snapshots import read_snapshots
from msrr_bullet.timeline.series import TrialSeries
from msrr_bullet.viewer.replay_data import replay_data
from msrr_scenes.messages import NS_PER_S, Pixels
from tests.bullet.recordings.conftest import Trial
from tests.bullet.recordings.mcap_files import png, write_ros2

#: Largest speed in the target file, which is the default [m/s].
SPEED_MPS = 0.25


def _standing(trial: Trial, *exposed_ms: int) -> list[tuple[int, int, Pixels]]:
    """Return the same picture at several times; it arrives at its exposure."""
    pixels = trial.frames()[0][2]
    return [(ms * 1_000_000, ms * 1_000_000, pixels) for ms in exposed_ms]


@pytest.mark.parametrize("period_ms", [100, 200])
def test_between_frames_the_robot_may_move_at_its_largest_speed(
    trial: Trial, tmp_path: Path, period_ms: int
) -> None:
    """Just before the next frame, the robot is where the last one showed it, by the way of a frame."""
    frames = _standing(trial, *range(period_ms, 7 * period_ms, period_ms))
    arrivals = [(s, a + period_ms * 999_000, p) for s, a, p in frames]  # just before the next exposure
    path = write_ros2(tmp_path / "film.mcap", arrivals, [])
    found: list[PerceivedInstant] = []
    result = perceive(path, trial.target, observer=found.append)
    estimate = found[-1].estimate
    assert estimate is not None
    # What the pixels leave open, 4 mm across the line of sight, adds 1 % to 25 mm.
    sigma = np.sqrt(np.diagonal(estimate.covariance)[:2])
    assert sigma == pytest.approx(1e-3 * SPEED_MPS * period_ms, rel=0.05)
    assert f"at {1000 // period_ms} Hz" in result.assumptions[0]
    with pytest.raises(RecordingError, match="--rate is for pictures"):
        perceive(path, trial.target, Options(rate_hz=10.0))


def test_the_rate_of_a_folder_says_how_far_the_robot_may_move(trial: Trial, tmp_path: Path) -> None:
    for k in range(3):
        (tmp_path / f"{k}.png").write_bytes(png(trial.frames()[0][2]))
    for rate_hz in (5.0, 20.0):
        text = perceive(tmp_path, trial.target, Options(rate_hz=rate_hz)).assumptions[0]
        assert (
            f"at {rate_hz:g} Hz, the robot is taken to move at random by about {250 / rate_hz:.0f} mm" in text
        )


def test_frames_with_the_same_stamp_count_once(trial: Trial, tmp_path: Path) -> None:
    path = write_ros2(tmp_path / "film.mcap", _standing(trial, 100, 100, 140), [])
    messages: list[str] = []
    result = perceive(path, trial.target, report=messages.append)
    assert (result.frames, result.used, result.unusable) == (3, 2, 1)
    assert len(messages) == 1
    assert "has the time stamp of another frame" in messages[0]


def test_frames_that_arrive_together_are_both_used(trial: Trial, tmp_path: Path) -> None:
    pixels, together_ns = trial.frames()[0][2], 150_000_000
    frames = [(100_000_000, together_ns, pixels), (140_000_000, together_ns, pixels)]
    result = perceive(write_ros2(tmp_path / "film.mcap", frames, []), trial.target)
    assert (result.frames, result.used, result.instants) == (2, 2, 2)


def test_pages_plots_and_pictures_count_from_the_first_message(trial: Trial, tmp_path: Path) -> None:
    """A picture arrives 60 ms after its exposure, and what follows from it has that time everywhere."""
    start_ns = 1_700_000_000_300_000_000
    frames = [(s, s + 60_000_000, pixels) for s, _, pixels in _standing(trial, 0, 100, 200)]
    path = write_ros2(tmp_path / "film.mcap", frames, [], start_ns=start_ns)
    result = perceive(path, trial.target, out=tmp_path / "run")
    assert result.start_ns == start_ns
    log = read_log(tmp_path / "run")
    snapshots, scene = read_snapshots(log), log.header.scene
    assert [exposure.stamp_ns for exposure in read_exposures(log)] == [0, 100_000_000, 200_000_000]
    told = [0.06, 0.16, 0.26]
    assert TrialSeries.of(scene, snapshots).time.tolist() == told
    page = replay_data(scene, snapshots, draw_stills(log, snapshots), [])
    assert page["times"] == told
    assert page["stills"][0]["times"][0] == 0.0


def test_a_clock_that_goes_back_is_refused(trial: Trial, tmp_path: Path) -> None:
    """Read by their times, the frames before would be mixed with those behind."""
    frames = _standing(trial, 3000, 3040, 3080, 20, 60)
    path = write_ros2(tmp_path / "film.mcap", frames, [], start_ns=NS_PER_S, ordered=False)
    with pytest.raises(
        RecordingError, match=r"film\.mcap: its clock goes back by 3\.1 s while /camera/image"
    ):
        perceive(path, trial.target)


@pytest.mark.parametrize(("late_ms", "apart"), [(5000, "before"), (-5000, "after")])
def test_stamps_far_from_their_recording_are_refused_and_an_earlier_run_is_kept(
    trial: Trial, tmp_path: Path, late_ms: int, apart: str
) -> None:
    out, frames = tmp_path / "run", _standing(trial, 6000, 6040)
    perceive(write_ros2(tmp_path / "good.mcap", frames, []), trial.target, out=out)
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    late = [(stamp, arrival + late_ms * 1_000_000, pixels) for stamp, arrival, pixels in frames]
    path = write_ros2(tmp_path / "late.mcap", late, [])
    with pytest.raises(RecordingError, match=rf"its stamps are 5\.0 s {apart} their recording"):
        perceive(path, trial.target, out=out)
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before
