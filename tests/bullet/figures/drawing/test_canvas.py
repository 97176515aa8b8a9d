"""Lines and text on an image."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.figures.drawing.canvas import BAR, Canvas, Key, titled
from msrr_bullet.figures.drawing.mission_marks import short_name


def test_points_far_outside_and_unknown_points_are_not_drawn() -> None:
    canvas = Canvas(20, 10, 2)
    blank = canvas.image.copy()
    canvas.line([[0.0, 0.0], [1e9, 0.0]], 0)
    canvas.line([[np.nan, 0.0], [1.0, 1.0]], 0)
    canvas.dot([np.nan, 1.0], 0, 3.0)
    canvas.text([1e9, 0.0], "text", 0)
    assert np.array_equal(canvas.image, blank)
    canvas.line([[0.0, 5.0], [19.0, 5.0]], 0)
    assert (canvas.image < 200).any()


def test_a_dashed_line_has_gaps() -> None:
    solid, dashed = Canvas(100, 9, 1), Canvas(100, 9, 1)
    for canvas, dashes in ((solid, False), (dashed, True)):
        canvas.line([[0.0, 4.0], [99.0, 4.0]], 0, dashed=dashes)
    dark = [int((canvas.image[4, :, 0] < 128).sum()) for canvas in (solid, dashed)]
    assert 0.4 * dark[0] < dark[1] < 0.8 * dark[0]


def test_title_and_legend_take_lines_above_and_below() -> None:
    image = np.zeros((30, 200, 3), dtype=np.uint8)
    legend = [Key(0xFF0000, "one entry that is long"), Key(0x00FF00, "another long entry", dashed=True)]
    framed = titled(image, ["a title that is too long for two hundred pixels", "second line"], legend)
    assert framed.shape == (30 + 2 * BAR + 2 * BAR, 200, 3)
    assert np.array_equal(framed[2 * BAR : 2 * BAR + 30], image)


@pytest.mark.parametrize(
    ("name", "shown"), [("a", "a"), ("twelve_chars", "twelve_chars"), ("thirteen_char", "thirte..char")]
)
def test_a_long_name_loses_its_middle(name: str, shown: str) -> None:
    assert short_name(name) == shown
