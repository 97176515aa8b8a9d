"""Plots and pictures are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from msrr_bullet.figures.drawing.canvas import write_png
from msrr_bullet.figures.plots.style import new_figure, save
from msrr_scenes.errors import MsrrError
from msrr_scenes.whole_files import write_named

Room = Callable[[int], AbstractContextManager[None]]
Write = Callable[[Path], Path]


def _plot(path: Path) -> Path:
    figure = new_figure(4.0, 3.0)
    figure.subplots().plot(range(5))
    return save(figure, path)


def _picture(path: Path) -> Path:
    return write_png(path, np.random.default_rng(0).integers(0, 255, (90, 160, 3), dtype=np.uint8))


@pytest.mark.parametrize(
    ("write", "name"), [(_plot, "f.png"), (_plot, "f.pdf"), (_plot, "f.svg"), (_picture, "f.png")]
)
def test_a_full_disk_leaves_the_older_figure_or_none(
    tmp_path: Path, room: Room, write: Write, name: str
) -> None:
    path = tmp_path / name
    _plot(tmp_path / "first.png")  # matplotlib may write its list of fonts once
    (tmp_path / "first.png").unlink()
    for before in ([], [name]):
        with room(512), pytest.raises(MsrrError, match=rf"{name}: cannot be written \(File too large\)"):
            write(path)
        assert os.listdir(tmp_path) == before
        path.write_text("older")
    assert path.read_text() == "older"
    write(path)
    assert os.listdir(tmp_path) == [name]
    assert path.stat().st_size > 512


def test_a_disk_without_any_room_is_named_by_the_name_that_was_given(tmp_path: Path) -> None:
    link = tmp_path / "plot.png"
    link.symlink_to("/dev/full")
    with pytest.raises(MsrrError, match=r"plot\.png: cannot be written \(No space left on device\)"):
        write_named(link, b"picture")
    assert os.listdir(tmp_path) == ["plot.png"]


def test_an_interrupt_leaves_the_older_plot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _plot(tmp_path / "plot.png")
    before = path.read_bytes()
    draw = FigureCanvasAgg.draw

    def interrupted(canvas: FigureCanvasAgg) -> None:
        draw(canvas)
        raise KeyboardInterrupt

    monkeypatch.setattr(FigureCanvasAgg, "draw", interrupted)
    with pytest.raises(KeyboardInterrupt):
        _plot(path)
    assert os.listdir(tmp_path) == ["plot.png"]
    assert path.read_bytes() == before
