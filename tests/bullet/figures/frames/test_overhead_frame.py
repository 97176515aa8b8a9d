"""Annotated frames of the overhead camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from msrr_bullet.figures.drawing.canvas import bgr
from msrr_bullet.figures.drawing.perspective import Perspective, on_floor, scene_solids
from msrr_bullet.figures.frames.overhead_frame import draw_overhead
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.camera_views import CameraView
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import OVERHEAD
from tests.bullet.conftest import with_step


def test_an_overhead_frame_shows_truth_belief_plan_and_detections(count_pixels, views, trial, context):
    view = [v for v in views if v.exposure.camera == OVERHEAD and v.tags][5]
    snapshot = trial.at(view.stamp_ns)
    picture = draw_overhead(context, view, snapshot, trial.until(view.stamp_ns))
    for name in ("PATH", "BELIEF", "PLAN", "DETECTION", "WINDOW", "CLEARANCE"):
        assert count_pixels(picture.image, getattr(palette, name)) > 20, name
    title = " ".join(picture.title)
    for text in ("two_units, seed 3", "overhead", "assemble", "attempt 1", "mm off"):
        assert text in title


def test_lines_are_drawn_where_they_meet_the_tags(views, trial, context):
    """The middle of a unit, drawn as lines are, is in the image where its top tag was detected."""
    perspective = Perspective.overhead(context.scene, context.built)
    tags = {ids["tag_top"]: u for u in context.scene.units if "tag_top" in (ids := context.scene.tag_ids(u))}
    view = [v for v in views if v.exposure.camera == OVERHEAD and v.tags][5]
    found = {tags[t.tag_id]: t.corners.mean(axis=0) for t in view.tags if t.tag_id in tags}
    assert len(found) == 2
    for unit, middle in found.items():
        at = trial.at(view.stamp_ns).units[unit].translation
        drawn = perspective.pixels(on_floor(at, context.top_tags_m))[0]
        np.testing.assert_allclose(drawn, middle, atol=1.5)


def test_belief_is_drawn_where_it_is(views, trial, context):
    """A belief 20 cm off is drawn 20 cm off."""
    view = [v for v in views if v.exposure.camera == OVERHEAD and v.tags][5]
    snapshot = trial.at(view.stamp_ns)
    wrong = with_step(
        replace(snapshot, clearance=None), estimate=snapshot.first.estimate @ SE2(0.0, 0.2), assembly=None
    )
    image = draw_overhead(context, CameraView(view.exposure, view.lens), wrong, ()).image
    ghost = SE3.from_se2(wrong.first.estimate).act(scene_solids(context.scene, context.built)["a"].points)
    hull = Perspective.overhead(context.scene, context.built).hull(ghost)
    for x, y in hull:
        near = image[int(y) - 2 : int(y) + 4, int(x) - 2 : int(x) + 4]
        assert (np.abs(near.astype(int) - bgr(palette.BELIEF)).max(axis=2) < 60).any()
