"""What the figure of residuals says of tags and pictures that were left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from msrr_bullet.tag_mapping import residual_figure
from msrr_bullet.timeline.palette import VERMILLION, css
from msrr_perception.mapping.mapper import TaggedPicture, map_tags
from tests.perception.mapping.test_mapper import LENS, TAG_SIZE, photographed, wall


def test_it_names_what_was_left_out_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture of which nothing is used has no residual: no point, but a coloured name, and a place
    in the title."""
    rng = np.random.default_rng(5)
    pictures = photographed(wall(rng), rng)
    wrong = tuple(replace(t, corners=t.corners + rng.normal(0.0, 30.0, 2)) for t in pictures[2].tags)
    pictures[2] = TaggedPicture(pictures[2].name, wrong)
    found = map_tags(pictures, LENS, TAG_SIZE)
    drawn: list[Figure] = []
    monkeypatch.setattr(residual_figure, "save", lambda figure, path: drawn.append(figure) or path)
    residual_figure.draw_residuals(found, tmp_path / "residuals.png")
    (figure,) = drawn
    left_out = [s for s in found.sightings if not s.kept]
    title = figure.get_suptitle()
    assert title.startswith(residual_figure.headline(found))
    assert f"; {len(left_out)} of {len(found.sightings)} sightings left out,\n{len(wrong)} of them" in title
    names = {label for axes in figure.axes for label in axes.get_xticklabels()}
    assert {n.get_text() for n in names if n.get_color() == css(VERMILLION)} == {pictures[2].name}
    ticks = [tick.get_text() for tick in figure.axes[0].get_yticklabels()]
    assert "1" in ticks
    assert not any("e" in text for text in ticks)
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert "picture (coloured: left out)" in labels
    monkeypatch.setattr(residual_figure, "_MOST_NAMES", 2)  # names are left out, and with them their colours
    residual_figure.draw_residuals(found, tmp_path / "residuals.png")
    assert not any("coloured" in axes.get_xlabel() for axes in drawn[1].axes)
