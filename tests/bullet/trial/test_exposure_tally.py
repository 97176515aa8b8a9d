"""Exposures that do not agree with a filter are counted and told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msrr_bullet.log import Event, MemoryRecorder
from msrr_bullet.run import run_trial
from msrr_bullet.trial.exposure_tally import ExposureTally
from msrr_bullet.trial.trial import Trial
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Detections, ExposureCounts, PoseEstimate

ESTIMATE = PoseEstimate(0, SE2(), np.eye(3), 0)


def counted(used: int, without_wheels: int = 0, rejected: int = 0) -> PoseEstimate:
    return replace(ESTIMATE, exposures=ExposureCounts(used, without_wheels, rejected))


def test_the_tally_goes_on_when_a_filter_is_reset_or_lost() -> None:
    tally = ExposureTally(counted(5, 0, 2))  # an earlier step used the same filter
    for estimate in (counted(7, 0, 2), None, counted(8, 1, 3), counted(1), None, counted(2, 0, 1)):
        tally.add(estimate)
    assert tally.counts == ExposureCounts(used=3 + 2, without_wheels=1, rejected=1 + 1)


def test_an_estimator_of_a_user_s_own_counts_nothing() -> None:
    tally = ExposureTally(None)
    tally.add(ESTIMATE)
    assert tally.counts is None
    assert tally.warning("onboard") is None


@pytest.mark.parametrize(
    ("counts", "told"),
    [((98, 1, 1), None), ((8, 1, 1), None), ((80, 5, 15), "20 of 100 exposures of the onboard camera")],
)
def test_many_exposures_that_do_not_agree_are_told(counts: tuple[int, int, int], told: str | None) -> None:
    tally = ExposureTally(None)
    tally.add(counted(*counts))
    warning = tally.warning("onboard")
    assert warning is None if told is None else str(warning).startswith(told)


#: A route of 10 s around a post, and a dock.
SHORT = {
    "as_built": "careful",
    "plant": "unicycle",
    "units.a.pose.x_m": "-0.1",
    "units.a.pose.y_m": "0.05",
    "units.a.pose.yaw_deg": "20",
    "obstacles.post.pose.x_m": "0.1",
    "obstacles.post.pose.y_m": "-0.45",
}


def test_the_filters_of_a_sound_trial_use_every_exposure() -> None:
    """They did not agree with four of five overhead exposures, and nobody saw it: poses were good enough."""
    recorder = MemoryRecorder()
    step = Trial(load_scene("two_units", SHORT), 3, recorder=recorder).run().decisive_step
    assert step is not None
    messages = [message for *_, message in recorder.messages]
    for camera, counts in (("onboard", step.onboard_exposures), ("overhead", step.overhead_exposures)):
        assert counts is not None
        read = [m for m in messages if isinstance(m, Detections) and camera in m.exposure.camera]
        assert 0.8 * sum(bool(m.tags) for m in read) < counts.used <= len(read)
        assert counts.used == counts.total
    assert not any("do not agree" in event.text for event in messages if isinstance(event, Event))


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("grade", "most"), [("perfect", 0.0), ("careful", 0.002), ("workshop", 0.01), ("rough", 0.03)]
)
def test_filters_agree_with_robots_of_every_grade(grade: str, most: float) -> None:
    """Of 12 missions together; those that ended without a dock tell as well."""
    total = ExposureCounts()
    for seed in range(12):
        result = run_trial(load_scene("two_units", {"as_built": grade}), seed)
        for step in result.steps:
            for counts in (step.onboard_exposures, step.overhead_exposures):
                total += counts or ExposureCounts()
    print(f"{grade}: {100 * total.disagreeing:.2f} % of {total.total} exposures do not agree")
    assert total.disagreeing <= most
