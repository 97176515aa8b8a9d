"""Cells of a table."""

from __future__ import annotations

import math

import numpy as np

from msrr_bullet.export.table import sigma, text, time
from msrr_scenes.messages import LosStatus


def test_cells():
    assert [text(c) for c in (None, math.nan, True, False, 0.1, -0.0, 3, math.inf)] == [
        *("", "", "1", "0", "0.1", "-0.0", "3", "inf")
    ]
    assert text(LosStatus.SEEN) == "seen"
    assert text(np.float64(0.5)) == "0.5"
    assert text("off\x1b[31m\0\x85 by 2°\n\t1") == r"off\x1b[31m\x00\x85 by 2°" + "\n\t1"
    assert (time(0), time(1_500_000_001), time(62_500_000)) == ("0.000000000", "1.500000001", "0.062500000")
    assert (time(-30_000_000), time(-1_500_000_000)) == ("-0.030000000", "-1.500000000")


def test_a_negative_variance_is_unknown():
    assert text(sigma(np.diag([0.25, -1.0, 0.0]))[1]) == ""
    assert sigma(np.diag([0.25, -1.0, 0.0]))[0] == 0.5
