"""The long-distance phase of a trial of the loop over time."""

import math

import numpy as np

from msrr_bullet.timeline.path_following_series import PathFollowingSeries


def test_each_path_of_the_loop_counts_for_itself() -> None:
    """A new path a metre beside the old one, which the unit was on all the time."""
    x = np.linspace(0.0, 1.0, 20)
    old, new = np.stack([x, np.zeros(20)], axis=-1), np.stack([x, np.ones(20)], axis=-1)
    series = PathFollowingSeries(
        time=0.02 * np.arange(40),
        tip=np.concatenate([old, old]),
        desired=np.concatenate([old, new]),
        path=np.repeat([1, 2], 20),
        walled=np.zeros(40, dtype=bool),
        arc_end=math.nan,
    )
    np.testing.assert_allclose(series.from_path(), np.repeat([0.0, 1.0], 20), atol=1e-12)
