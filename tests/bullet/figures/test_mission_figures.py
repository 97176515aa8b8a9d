"""Pictures of a mission: all units, their ways and routes, who waits for whom, and what each did."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msrr_bullet.cli.app import run
from msrr_bullet.figures.drawing.canvas import Canvas, on_paper, table
from msrr_bullet.figures.drawing.mission_marks import docked_pairs, driven_way
from msrr_bullet.figures.frames.annotation import DrawingContext
from msrr_bullet.figures.frames.frame_files import FrameAnnotator
from msrr_bullet.figures.frames.overhead_frame import draw_overhead
from msrr_bullet.figures.plots import mission_chart
from msrr_bullet.figures.plots.mission_chart import draw_mission_chart
from msrr_bullet.figures.plots.run_plot import write_plot
from msrr_bullet.figures.plots.summary import write_picture
from msrr_bullet.figures.plots.top_view import draw_top_view
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.mission_series import EventKind, MissionEvent, activity_spans, unit_events
from msrr_scenes.camera_lenses import camera_lenses
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import OVERHEAD, Exposure
from msrr_scenes.messages.coordination import UnitState


@pytest.fixture(scope="module")
def scene(mission_run):
    return mission_run.log.header.scene


@pytest.fixture(scope="module")
def drawn():
    figure = Figure(figsize=(8, 6))
    FigureCanvasAgg(figure)

    def draw(function, *arguments):
        axes = figure.add_subplot()
        function(axes, *arguments)
        figure.draw_without_rendering()
        return axes

    return draw


def overhead(mission_run, snapshot, past=()):
    scene = mission_run.log.header.scene
    view = CameraView(Exposure(OVERHEAD, -1, snapshot.stamp_ns), camera_lenses(scene)[OVERHEAD])
    return draw_overhead(DrawingContext(scene, 1), view, snapshot, past)


def test_the_picture_shows_every_unit_in_its_colour(count_pixels, mission_run, scene, tmp_path):
    image = cv2.imread(
        str(write_picture(tmp_path / "run.png", scene, mission_run.snapshots, headline="complete"))
    )
    for unit, colour in palette.unit_colours(scene).items():
        assert count_pixels(image, colour) > 1000, unit
    for activity in ("DRIVING", "DOCKING", "IN_PLACE"):
        colour = palette.ACTIVITY_COLOURS[getattr(palette.Activity, activity)]
        assert count_pixels(image, colour, 2) > 500, activity


def test_the_view_from_above_has_the_way_of_each_unit_and_a_bar_at_each_docked_pair(
    drawn, mission_run, scene
):
    axes = drawn(draw_top_view, scene, mission_run.snapshots)
    lines = {line.get_color(): line for line in axes.lines if line.get_alpha() is None}
    for unit, colour in palette.unit_colours(scene).items():
        way = np.column_stack(lines[palette.css(colour)].get_data())
        first, last = mission_run.snapshots[0].units[unit], mission_run.snapshots[-1].units[unit]
        assert np.linalg.norm(way[0] - first.translation) < 0.01, unit
        assert np.linalg.norm(way[-1] - last.translation) < 0.01, unit
    pairs = docked_pairs(scene, mission_run.snapshots[-1])
    assert len(pairs) == 3
    for unit, (a, b) in pairs.items():
        port = scene.geometry(unit).port("front")
        tip = mission_run.snapshots[-1].units[unit] @ port
        assert np.linalg.norm(0.5 * (a + b) - tip.translation) < 0.01
    assert {text.get_text() for text in axes.texts} >= set(scene.units)


def test_the_view_of_a_mission_that_stopped_names_who_failed_and_who_waits(drawn, mission_run, scene):
    stopped = mission_run.waiting
    waiting = next(u for u in stopped.units if stopped.mission.waits_for(u))
    other = next(u for u in stopped.units if u not in (waiting, stopped.mission.waits_for(waiting)))
    units = tuple(
        replace(u, state=UnitState.FAILED) if u.unit == other else u for u in stopped.mission.status.units
    )
    status = replace(stopped.mission.status, units=units)
    stopped = replace(stopped, mission=replace(stopped.mission, status=status))
    axes = drawn(draw_top_view, scene, [mission_run.snapshots[0], stopped])
    assert f"{other} failed" in {text.get_text() for text in axes.texts}
    labels = {text.get_text() for text in axes.get_legend().get_texts()}
    assert {"waits for", "route, not granted"} <= labels


def test_the_chart_has_a_bar_for_every_span_and_hatches_the_time_of_waiting(drawn, mission_run, scene):
    axes = drawn(draw_mission_chart, scene, mission_run.snapshots)
    spans = [span for unit in scene.units for span in activity_spans(mission_run.snapshots, unit)]
    bars = [c for c in axes.collections if c.get_paths()[0].get_extents().height > 0.5]
    assert len(bars) == len(spans)
    assert sum(bar.get_hatch() is not None for bar in bars) == sum(s.waits_for is not None for s in spans) > 0
    assert [label.get_text() for label in axes.get_yticklabels()] == list(scene.units)
    labels = {text.get_text() for text in axes.get_legend().get_texts()}
    assert {"docked", "route granted", "not heard by the base station"} <= labels


def test_the_name_of_a_route_ends_where_that_of_the_next_begins(drawn, mission_run, scene, monkeypatch):
    """A unit that made way and then got its own route had both written over each other."""
    soon = [
        MissionEvent(EventKind.GRANTED, time_s, text) for time_s, text in ((1.0, "makes way"), (1.2, "to"))
    ]
    monkeypatch.setattr(mission_chart, "unit_events", lambda snapshots, unit: iter(soon))
    axes = drawn(draw_mission_chart, scene, mission_run.snapshots)
    first, second = (next(t for t in axes.texts if t.get_text() == event.text) for event in soon)
    x, _ = axes.transData.transform((second.get_position()[0], 0.0))
    room = first.get_clip_box()
    assert room is not None
    assert first.get_window_extent().x1 > x > room.x1


def test_a_unit_that_got_no_route_has_its_row_without_a_name_of_one(drawn, mission_run, scene):
    """A trial that ends early leaves units that were never sent anywhere."""
    early = mission_run.snapshots[:1]
    assert not any(event.kind is EventKind.GRANTED for u in scene.units for event in unit_events(early, u))
    axes = drawn(draw_mission_chart, scene, early)
    assert [label.get_text() for label in axes.get_yticklabels()] == list(scene.units)


def test_the_plot_of_a_mission_is_its_chart_and_that_of_a_unit_its_curves(
    count_pixels, mission_run, scene, tmp_path
):
    in_place = palette.ACTIVITY_COLOURS[palette.Activity.IN_PLACE]
    snapshots = mission_run.snapshots[::5]
    chart = write_plot(tmp_path / "mission.png", scene, snapshots)
    curves = write_plot(tmp_path / "a.png", scene, snapshots, unit="a")
    assert count_pixels(chart, in_place, 2) > 1000 > count_pixels(curves, in_place, 2)
    assert count_pixels(curves, palette.PATH, 3) > 100
    root = next(u.unit for u in snapshots[-1].mission.status.units if u.task == "p0")
    alone = write_plot(tmp_path / "root.png", scene, snapshots, unit=root)  # it has no port to go to
    assert count_pixels(alone, palette.PATH, 3) > 100
    with pytest.raises(MsrrError, match="unit 'x' has no step in this run; units with one: "):
        write_plot(tmp_path / "x.png", scene, snapshots, unit="x")


def test_an_overhead_frame_shows_ways_routes_waiting_and_docked_pairs(count_pixels, mission_run, scene):
    moving = mission_run.waiting
    past = [s for s in mission_run.snapshots if s.stamp_ns <= moving.stamp_ns]
    frame = overhead(mission_run, moving, past)
    nobody = tuple(replace(u, blocked_by=None) for u in moving.mission.status.units)
    status = replace(moving.mission.status, units=nobody)
    alone = overhead(mission_run, replace(moving, mission=replace(moving.mission, status=status)), past)
    arrow = count_pixels(frame.image, palette.ALARM) - count_pixels(alone.image, palette.ALARM)
    assert arrow > 100
    for unit, colour in palette.unit_colours(scene).items():
        assert count_pixels(frame.image, colour, 60) > 50, unit
    end = overhead(mission_run, mission_run.snapshots[-1], mission_run.snapshots)
    apart = {
        unit: replace(report, docked_to=None)
        for unit, report in mission_run.snapshots[-1].mission.reports.items()
    }
    loose = replace(
        mission_run.snapshots[-1], mission=replace(mission_run.snapshots[-1].mission, reports=apart)
    )
    without = overhead(mission_run, loose, mission_run.snapshots)
    assert (end.image != without.image).any(axis=2).sum() > 200  # the bars of the docked pairs
    assert [cells[0] for _, cells in frame.table[1:]] == list(scene.units)
    assert frame.titled().shape[1] > frame.image.shape[1]


@pytest.mark.nightly
def test_all_frames_of_a_mission_and_its_film_are_written(mission_by_images):
    """Frames of units whose step the plan does not hold, and of units that have no step at all."""
    assert run(["frames", str(mission_by_images.folder), "--count", "2"]) == 0
    assert run(["film", str(mission_by_images.folder), "--show", "all", "--speed", "50"]) == 0
    folder = mission_by_images.folder / "frames"
    cameras = {path.name.rsplit("_", 1)[0] for path in folder.glob("*.png")} - {"sheet.png"}
    docked = [u for u in "abcd" if mission_by_images.snapshots[-1].mission.docked_to(u)]
    assert {"overhead", *(f"{unit}_onboard" for unit in docked)} <= cameras
    read, image = cv2.VideoCapture(str(mission_by_images.folder / "film.mp4")).read()
    assert read
    assert image.shape == (720, 1280, 3)


def test_the_film_watches_the_unit_that_docks(mission_run):
    annotator = FrameAnnotator(mission_run.log)
    for snapshot in mission_run.snapshots[::50]:
        docking = [s.unit for s in snapshot.steps if s.phase.value in ("dock", "lock", "verify", "tug_test")]
        name = annotator.onboard_at(snapshot.stamp_ns)
        assert not docking or name.partition("/")[0] in docking


def test_a_way_leaves_out_points_that_lie_together(mission_run):
    way = driven_way(mission_run.snapshots, "a")
    steps = np.hypot(*np.diff(way, axis=0).T)
    assert 0.003 < steps.min() <= steps.max() < 0.05


def test_an_arrow_ends_at_its_point_and_a_table_keeps_its_width(count_pixels):
    canvas = Canvas(100, 60, 2)
    canvas.arrow(np.array([10.0, 30.0]), np.array([80.0, 30.0]), palette.ALARM)
    ys, xs = np.nonzero((canvas.image != 255).any(axis=2))
    assert abs(xs.max() / 2 - 80.0) < 2.0
    assert abs(xs.min() / 2 - 10.0) < 2.0
    assert ys[xs > 140].max() - ys[xs > 140].min() > 5  # the head is wider than the shaft
    canvas.arrow(np.array([10.0, 30.0]), np.array([10.0, 30.0]), palette.ALARM)  # has no direction
    image = table([(palette.BLUE, ("a", "a text that does not fit" * 9)), (palette.GREEN, ("b", ""))], 300)
    assert image.shape[1] == 300
    assert count_pixels(image, palette.BLUE, 2) > 50 < count_pixels(image, palette.GREEN, 2)
    assert on_paper(image, 500, 10).shape == (10, 500, 3)
