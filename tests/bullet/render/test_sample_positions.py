"""Positions of the samples in a pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_bullet.render.raster.kernels.sample_positions import CELL_SAMPLES, SAMPLES, sample_positions


@pytest.mark.parametrize("samples", [SAMPLES, CELL_SAMPLES])
def test_samples_share_no_row_and_no_column_and_have_no_bias(samples: int) -> None:
    positions = sample_positions(samples)
    steps = (np.arange(samples) + 0.5) / samples
    for axis in range(2):
        np.testing.assert_allclose(np.sort(positions[axis]), steps, atol=1e-7)
    worst, squares = 0.0, []
    for angle in np.linspace(0.0, math.pi, 60, endpoint=False) + 0.01:
        a, b = math.cos(angle), math.sin(angle)
        along = (positions[0] - 0.5) * a + (positions[1] - 0.5) * b
        for t in np.linspace(-0.7, 0.7, 41):
            p, q, x = abs(a), abs(b), t + 0.5 * (abs(a) + abs(b))
            area = sum(s * max(x - o, 0.0) ** 2 for s, o in ((1, 0), (-1, p), (-1, q), (1, p + q))) / (
                2 * p * q
            )
            error = float((along < t).mean()) - area
            worst = max(worst, abs(error))
            squares.append(error**2)
    assert worst < {16: 0.11, 32: 0.075}[samples]
    assert math.sqrt(np.mean(squares)) < {16: 0.031, 32: 0.0185}[samples]
