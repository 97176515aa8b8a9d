"""Annotated frames of the onboard camera."""

from __future__ import annotations

import math

import numpy as np

from msrr_bullet.figures.drawing.canvas import bgr
from msrr_bullet.figures.frames.onboard_frame import draw_onboard
from msrr_bullet.timeline import palette


def test_an_onboard_frame_shows_cone_edges_belief_and_detections(
    count_pixels, short_log, views, trial, context
):
    view = [v for v in views if v.exposure.camera == "a/onboard" and v.tags][-1]
    picture = draw_onboard(context, view, trial.at(view.stamp_ns))
    for name in ("SIGHT", "BELIEF", "DETECTION", "WINDOW"):
        assert count_pixels(picture.image, getattr(palette, name)) > 20, name
    camera, los = view.camera, short_log.header.scene.los
    zoom = picture.image.shape[1] / camera.width
    column = round((camera.cx - camera.focal * math.tan(los.outer) + 0.5) * zoom - 0.5)
    vertical = np.abs(picture.image[:, column - 1 : column + 2].astype(int) - bgr(palette.PLAN)).max(axis=2)
    assert (vertical.min(axis=1) < 40).mean() > 0.95, "the bound of the cone is a line from top to bottom"
    assert "attempt 1" in picture.title[1]
    assert "line of sight seen" in picture.title[2]
