"""The figure of every trial as a dot."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from msrr_bullet.reproduce.report import strip_plot
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import Measured, Row, rates_of


def test_a_trial_that_hit_the_obstacle_is_shown() -> None:
    """Its clearance is negative, and lay beyond the left edge."""
    clearances = [-0.05, -0.02, 0.01, 0.1]
    row = Row(
        controller="c2",
        label="C2",
        trials=4,
        **rates_of(success=np.array(clearances) > 0.0),
        measures={"clearance": Measured.of(clearances)},
    )
    axes = Figure().subplots()
    strip_plot._draw_strip(axes, [row], measure("clearance"), has_targets=False)
    left, right = axes.get_xlim()
    (dots,) = axes.collections
    x = np.asarray(dots.get_offsets())[:, 0]
    assert len(x) == 4
    assert left < x.min() < x.max() < right
