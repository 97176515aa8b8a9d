"""Intervals of quantiles, and the figure of the ablations that shows them."""

import math
from pathlib import Path

import numpy as np

from msrr_bullet.reproduce.report.ablation_plot import Estimate, draw_ablations, estimate_quantile
from msrr_bullet.studies.model import Ablations, Measured, Row, Table, rates_of


def test_a_bound_that_too_few_trials_give_is_infinite() -> None:
    """The interval itself is that of `msrr_bullet.statistics`, with its tests."""
    assert estimate_quantile(Measured.of([1.0, 2.0, 3.0]), 0.95) == Estimate(2.9, 2.0, math.inf)
    assert estimate_quantile(Measured.of([1.0, 2.0, 3.0]), 0.05) == Estimate(1.1, -math.inf, 2.0)


def test_infinite_quantiles_have_infinite_bounds() -> None:
    estimate = estimate_quantile(Measured.of([1.0] * 10 + [math.inf] * 10), 0.5)
    assert estimate == Estimate(math.inf, 1.0, math.inf)
    assert estimate_quantile(Measured.of([]), 0.5) is None


def test_infinite_percentiles_are_drawn(tmp_path: Path) -> None:
    every = np.ones(20, dtype=bool)
    rows = [
        Row(
            controller="c1",
            label=label,
            trials=20,
            **rates_of(success=every, in_view=every, in_cone=every),
            measures={"settling": Measured.of(settling), "final": Measured.of([0.001] * 20)},
        )
        for label, settling in (("C1", [1.0] * 18 + [math.inf] * 2), ("without it", [math.inf] * 20))
    ]
    table = Table(phase="close", plant="unicycle", setting="standard", description="", rows=tuple(rows))
    assert draw_ablations(Ablations(phase="close", tables=(table,)), tmp_path / "ablations.png").is_file()
