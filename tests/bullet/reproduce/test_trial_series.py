"""The close phase of a trial of the loop over time: settling, final error, and what was kept in view."""

import dataclasses
import math

import numpy as np
import pytest

from msrr_bullet.reproduce.trial_series import DockingSeries, SeriesRecorder
from msrr_bullet.trial.trial import Trial
from msrr_control.studies.docking_study import StudyResult
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Phase, seconds
from msrr_scenes.random_streams import stream
from tests.conftest import not_none

DT = 0.02


def _series(off: np.ndarray) -> DockingSeries:
    """An approach of the real loop whose tip is ``off`` beside the guidance trajectory."""
    steps = len(off)
    tip = np.stack([np.linspace(-0.5, 0.0, steps), off], axis=-1)
    reference = tip * [1.0, 0.0]
    return DockingSeries(
        time=DT * np.arange(steps),
        pose=np.zeros((steps, 3)),
        tip=tip,
        reference=reference,
        corrected=reference,
        edges=np.zeros((steps, 2)),
        command=np.zeros((steps, 2)),
        twist=np.zeros((steps, 2)),
    )


def _study(off: np.ndarray, contact: int) -> StudyResult:
    """The same errors as one trial of a study."""
    steps = len(off)
    tip = np.stack([np.linspace(-0.5, 0.0, steps), off], axis=-1)[:, None]
    pairs = np.zeros((steps, 1, 2))
    return StudyResult(
        DT, np.zeros((steps, 1, 3)), pairs, pairs, pairs, tip, tip * [1.0, 0.0], np.array([contact])
    )


def test_one_definition_for_both_plants() -> None:
    """Random errors, some of which end beyond the bound: both packages agree on every one of them."""
    rng = stream(5, "test/settling")
    never = 0
    for _ in range(60):
        off = np.abs(rng.normal(0.0, 0.03)) * np.exp(-DT * np.arange(100)) + rng.uniform(0.0, 0.02)
        found = _series(off).measures()
        # With the contact at the end, without one, and with one that more time comes after.
        for study in (_study(off, 99), _study(off, -1), _study(np.append(off, np.full(9, 0.5)), 99)):
            assert found["settling"] == pytest.approx(study.settling_time(0.015)[0])
            assert found["final"] == pytest.approx(study.final_error()[0])
            assert found["port"] == pytest.approx(study.port_error()[0])
        never += math.isinf(found["settling"])
    assert 10 < never < 50


def test_a_trial_that_leaves_the_bound_again_is_not_settled_before() -> None:
    off = np.full(100, 0.001)
    assert _series(off).measures()["settling"] == 0.0
    off[40] = 0.02
    assert _series(off).measures()["settling"] == pytest.approx(41 * DT)
    off[98] = 0.016
    assert _series(off).measures()["settling"] == pytest.approx(99 * DT)
    off[99] = 0.016
    assert _series(off).measures()["settling"] == math.inf
    assert _study(off, 99).settling_time(0.015)[0] == math.inf
    assert _study(off, 60).settling_time(0.015)[0] == pytest.approx(41 * DT)


def test_the_final_error_is_the_largest_of_the_last_second() -> None:
    off = np.full(101, 0.001)
    off[50] = 0.009  # a second before the end
    assert _series(off).measures()["final"] == pytest.approx(0.009)
    off[49] = 0.011  # before that
    assert _series(off).measures()["final"] == pytest.approx(0.009)


def test_a_target_lost_in_an_earlier_attempt_was_not_kept(blind_loop: dict[str, str]) -> None:
    """The first of two approaches looks away; the second is the one that is measured."""
    scene = load_scene("close_range", blind_loop)
    recorder = SeriesRecorder("a")
    Trial(scene, 0, recorder=recorder).run()
    way = [i for i in recorder.instants if i.action.phase is Phase.DOCK]
    close = not_none(DockingSeries.of(recorder.instants, scene, None))
    assert close.kept_within(scene.los.outer)
    again = [
        dataclasses.replace(i, action=dataclasses.replace(i.action, attempt=2))
        for i in recorder.instants
        if i.action.stamp_ns >= way[3].action.stamp_ns
    ]
    turned = [dataclasses.replace(i, true={**i.true, "a": i.true["a"] @ SE2(0.0, 0.0, 0.5)}) for i in way[:3]]
    both = not_none(DockingSeries.of([*turned, *again], scene, None))
    assert len(both.time) == len(close.time) - 3
    assert not both.kept_within(scene.los.outer)
    # A contact in the first approach says nothing about where the second ends.
    early = not_none(DockingSeries.of([*turned, *again], scene, seconds(turned[0].action.stamp_ns)))
    assert len(early.time) == len(both.time)
