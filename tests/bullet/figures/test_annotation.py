"""Pixels of annotated frames: read ones as they are, the others drawn from truth."""

from __future__ import annotations

import numpy as np

from msrr_bullet.figures.onboard_frame import draw_onboard
from msrr_bullet.figures.overhead_frame import draw_overhead
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.camera_views import CameraView
from msrr_perception.pose.overhead_model import OVERHEAD


def test_read_pixels_are_shown_as_they_are(views, trial, context):
    view = next(v for v in views if v.exposure.camera == OVERHEAD and v.windows and v.exposure.frame > 0)
    snapshot = trial.at(view.stamp_ns)
    image = draw_overhead(context, view, snapshot, ()).image
    frame, read = view.mosaic()
    same = (image == frame[..., None]).all(axis=2)
    assert same[read].mean() > 0.5  # lines are drawn over the rest
    assert same[~read].mean() < 0.01
    assert 0.0 < read.mean() < 0.2


def test_a_frame_without_pixels_is_drawn_from_truth_alone(count_pixels, views, trial, context):
    view = next(v for v in views if v.exposure.camera == "a/onboard")
    picture = draw_onboard(context, CameraView(view.exposure, view.camera), trial.at(view.stamp_ns))
    assert count_pixels(picture.image, palette.WINDOW) == 0
    assert np.ptp(picture.image.reshape(-1, 3), axis=0).min() > 100
