"""The close-range phase on unicycles: capture at the face, and one trial over time."""

from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.studies.docking_studies import captured, docking_row, docking_series
from msrr_bullet.studies.settings import STANDARD
from msrr_control.studies.docking_study import StudyResult
from msrr_scenes.errors import SceneError
from msrr_scenes.specs.spec import Choice

C1 = Choice(name="c1")

#: A controller of one's own that computes one command at a time.
LAWLESS = """
class Controller:
    def __init__(self, setup): ...
    def reset(self, inputs): ...
    def step(self, inputs): ...
"""

#: One around an array law, with parameters of its own.
LAWFUL = """
from msrr_control.docking.c1 import C1DockingLaw, C1DockingParams
from msrr_control.docking.controller import LawController

class Controller(LawController):
    def __init__(self, setup):
        super().__init__(C1DockingLaw(C1DockingParams(), setup))
"""


def test_captured_trials_are_at_the_face_within_both_bounds() -> None:
    """Just within and just beyond each of the two bounds, and a trial that never reached the face."""
    at_face = [(0.0129, 0.0), (-0.0131, 0.0), (0.0, 7.9), (0.0, -8.1), (0.0, 0.0)]
    pairs = np.zeros((2, 5, 2))
    tip, pose = pairs.copy(), np.zeros((2, 5, 3))
    tip[1, :, 1], pose[1, :, 2] = [y for y, _ in at_face], np.radians([yaw for _, yaw in at_face])
    contact = np.array([1, 1, 1, 1, -1])
    result = StudyResult(0.02, pose, pairs, pairs, pairs, tip, pairs, contact)
    assert captured(result).tolist() == [True, False, True, False, False]


def test_a_trial_over_time_ends_at_the_face() -> None:
    series = docking_series(C1, STANDARD, 3)
    assert series.tip[-1][0] == pytest.approx(0.0, abs=0.004)
    assert abs(series.error[-1][1]) < 0.01
    every = (series.time, series.tip, series.reference, series.command, series.twist, series.angles)
    assert len({len(values) for values in every}) == 1
    assert set(series.auxiliary) == {"xi", "cone shift [m]"}


def test_every_law_is_measured_against_the_port() -> None:
    """Park and Kuipers' law follows no trajectory: what keeps pace beside its noisy estimate is none.

    By that its final error was 13 mm, more than twice the 5 mm of noise; the port sees no such thing. 60
    trials at a fixed seed.
    """
    rows = {name: docking_row(Choice(name=name), name, STANDARD, range(60)) for name in ("graceful", "c1")}
    graceful, c1 = rows["graceful"], rows["c1"]
    assert graceful.measures["final"].count == graceful.measures["settling"].count == 0
    assert (graceful.within_paper, graceful.met) == (None, {})
    assert c1.measures["final"].count == 60
    for row in rows.values():
        port = row.measures["port"].by_trial()
        assert len(port) == 60
        # The last second ends at the contact.
        assert np.all(port >= row.measures["lateral"].by_trial() - 1e-6)
        assert np.quantile(port, 0.95) < 0.005
    assert np.all(c1.measures["port"].by_trial() <= c1.measures["final"].by_trial() + 1e-6)
    assert docking_series(Choice(name="graceful"), STANDARD, 0).reference == ()


def test_a_controller_without_an_array_law_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lawless.py").write_text(LAWLESS)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SceneError, match="not made of an array law"):
        docking_row(Choice(name="lawless:Controller"), "", STANDARD, range(1))


def test_an_array_law_of_one_s_own_is_measured_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was given the guidance of the shipped laws, which it does not take."""
    (tmp_path / "lawful.py").write_text(LAWFUL)
    monkeypatch.syspath_prepend(tmp_path)
    row = docking_row(Choice(name="lawful:Controller"), "own", STANDARD, range(20))
    assert row.measures["lateral"].count == 20
