"""The long-distance phase on unicycles: lag and swing told apart, and one trial over time."""

import numpy as np
import pytest

from msrr_bullet.studies.path_following_studies import (
    path_following_row,
    path_following_series,
    run_path_following,
)
from msrr_bullet.studies.settings import STANDARD
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.specs.spec import Choice

C1, C2 = Choice(name="c1"), Choice(name="c2")


@pytest.mark.nightly
def test_the_distance_to_the_path_leaves_out_the_lag() -> None:
    rows = [path_following_row(choice, choice.name.upper(), STANDARD, range(40)) for choice in (C1, C2)]
    for row in rows:
        assert {"amplitude", "amplitude_path", "recovery", "recovery_path"} <= set(row.measures)
        pairs = zip(row.measures["amplitude"].values, row.measures["amplitude_path"].values, strict=True)
        assert all(path <= point for point, path in pairs)
    p50 = {key: measured.quantiles.p50 or 0.0 for key, measured in rows[1].measures.items()}
    assert p50["amplitude"] - p50["amplitude_path"] > 0.05
    assert p50["recovery"] - p50["recovery_path"] > 0.2


def test_a_trial_over_time_passes_its_obstacle() -> None:
    series = path_following_series(C1, STANDARD, 3)
    assert series.obstacle is not None
    assert min(series.distance) > series.obstacle[2]
    assert set(series.auxiliary) == {"lambda_phi", "lambda", "lambda_s"}
    assert np.hypot(*np.array(series.error)[-1, :2]) < 0.03


def test_an_unknown_law_is_named() -> None:
    with pytest.raises(UnknownNameError, match="c3"):
        path_following_row(Choice(name="c3"), "C3", STANDARD, range(1))


def test_trials_at_a_slower_pace_last_until_the_end_of_their_arcs() -> None:
    slow = Choice(name="c1", params={"pace": {"cruise_mps": 0.11}})
    result = run_path_following(slow, STANDARD, range(10))
    assert np.isfinite(result.arc_end).all()
