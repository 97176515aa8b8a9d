"""Intervals of quantiles, and the figure of the ablations that shows them."""

import math
from pathlib import Path

import numpy as np

from msrr_bullet.reproduce.report.ablation_plot import draw_ablations
from msrr_bullet.reproduce.report.estimates import Estimate, estimate_quantile, quantile_interval
from msrr_bullet.studies.model import Ablations, Measured, Row, Table, rates_of
from msrr_scenes.random_streams import stream


def test_a_quantile_lies_between_two_order_statistics() -> None:
    values = list(range(1, 201))
    low, high = quantile_interval(values, 0.95)
    # Binomial (200, 0.95): P(X <= 183) = 0.0238, P(X <= 184) = 0.0444; P(X >= 197) = 0.0090,
    # P(X >= 196) = 0.0264.
    assert (low, high) == (184.0, 197.0)
    assert quantile_interval([1.0, 2.0, 3.0], 0.95) == (2.0, math.inf)
    rng = stream(4, "test/quantiles")
    inside = 0
    for _ in range(400):
        low, high = quantile_interval(list(rng.uniform(size=60)), 0.5)
        inside += low <= 0.5 <= high
    # At least 95 % by construction; 400 trials at a fixed seed, 0.92 is 2.8 standard deviations below.
    assert inside >= 0.92 * 400


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
