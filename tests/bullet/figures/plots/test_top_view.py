"""View of a trial from above."""

from __future__ import annotations

import re

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msrr_bullet.figures.plots.top_view import MARGIN, draw_top_view, extent
from msrr_scenes.messages import Phase
from tests.bullet.conftest import with_step


def test_the_extent_holds_every_body(drive):
    (x0, x1), (y0, y1) = extent(drive.scene, drive.snapshots)
    reach = drive.scene.geometry("a").circumradius + MARGIN
    for snapshot in (drive.snapshots[0], drive.snapshots[-1]):
        for X in snapshot.units.values():
            assert x0 <= X.x - reach + 1e-9
            assert X.x + reach <= x1 + 1e-9
            assert y0 <= X.y - reach + 1e-9
            assert X.y + reach <= y1 + 1e-9


def test_the_title_names_the_instants_at_which_the_unit_is_drawn(drive):
    failed = [
        with_step(s, phase=Phase.RETREAT) if 120 <= i < 140 else s for i, s in enumerate(drive.snapshots)
    ]
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    draw_top_view(axes, drive.scene, failed)
    assert axes.get_title() == "from above: start, failed attempt, end"


def test_the_title_of_many_steps_is_short(drive):
    """It ran over the edge of the picture: every hand-over of four units stood in it."""
    phases = (Phase.ASSEMBLE, Phase.HAND_OVER, Phase.DOCK, Phase.RETREAT, Phase.ASSEMBLE)
    steps = [drive.scene.plan[0].model_copy(update={"to": f"b.{port}"}) for port in ("rear", "left", "right")]
    busy = [
        with_step(s, phase=phases[i // 4 % len(phases)], step=steps[i // 40 % len(steps)])
        for i, s in enumerate(drive.snapshots)
    ]
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    draw_top_view(axes, drive.scene, busy)
    counted = r"from above: start, hand-over \(10\), failed attempt \(\d+\), end"
    assert re.fullmatch(counted, axes.get_title())
