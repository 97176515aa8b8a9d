"""Pixels of annotated frames: read ones as they are, the others drawn from truth."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from msrr_bullet.figures.frames.annotation import DrawingContext
from msrr_bullet.figures.frames.frame_files import draw_view
from msrr_bullet.figures.frames.onboard_frame import draw_onboard
from msrr_bullet.figures.frames.overhead_frame import draw_overhead
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.series import port_in_dock
from msrr_scenes.camera_lenses import camera_lenses
from msrr_scenes.messages import NS_PER_S, OVERHEAD, Exposure, Phase
from msrr_scenes.specs.as_built import AsBuiltSpec
from tests.bullet.conftest import with_step


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
    picture = draw_onboard(context, CameraView(view.exposure, view.lens), trial.at(view.stamp_ns))
    assert count_pixels(picture.image, palette.WINDOW) == 0
    assert np.ptp(picture.image.reshape(-1, 3), axis=0).min() > 100


@pytest.mark.parametrize("camera", [OVERHEAD, "a/onboard"])
def test_truth_is_drawn_at_the_instant_of_the_exposure(camera, views, trial, context):
    """A camera whose clock is 30 ms ahead shows what it would show with a clock that is right."""
    view = next(v for v in views if v.exposure.camera == camera and v.stamp_ns > 3 * NS_PER_S)
    clocks = {"overhead": {"clock_ms": 30}, "onboard": {"clock_ms": 30}}
    scene = context.scene.model_copy(update={"as_built": AsBuiltSpec.model_validate(clocks)})
    ahead = replace(view, exposure=replace(view.exposure, stamp_ns=view.stamp_ns + 30_000_000))
    right, late = draw_view(context, view, trial).image, draw_view(context, ahead, trial).image
    assert (draw_view(DrawingContext(scene, context.seed), ahead, trial).image == right).all()
    assert (late != right).any()  # the unit is on its way


def test_a_caption_tells_the_present_and_not_how_the_phase_began(trial, context):
    """The reason of a phase's beginning stood under frames that were taken seconds later."""
    moving = [s for s in trial.snapshots if s.first.estimate is not None]
    assert moving[-1].stamp_ns - moving[0].stamp_ns > 5 * NS_PER_S
    lens = camera_lenses(context.scene)["a/onboard"]
    lines = []
    for snapshot in moving[:: len(moving) // 8]:
        view = CameraView(Exposure("a/onboard", -1, snapshot.stamp_ns), lens)
        line = draw_onboard(context, view, snapshot).title[1]
        first = snapshot.first
        for reason in (first.reason, first.assembly.reason if first.assembly else "none"):
            assert reason not in line
        gap, lateral, heading = port_in_dock(context.scene, snapshot, snapshot.first.estimate)
        shown = [float(n) for n in re.findall(r"[-+]?\d+\.?\d*", line.partition(":")[2])]
        assert shown == pytest.approx(
            [1e3 * gap, 1e3 * lateral, math.degrees(heading), snapshot.first.twist.v], abs=0.51
        )
        lines.append(line)
    assert len(set(lines)) == len(lines)


@pytest.mark.parametrize("phase", [Phase.RETREAT, Phase.FAILED])
def test_a_caption_gives_the_reason_that_stays_true(phase, trial, context):
    snapshot = with_step(trial.snapshots[-1], phase=phase, reason="no progress for 2.0 s")
    view = CameraView(Exposure("a/onboard", -1, snapshot.stamp_ns), camera_lenses(context.scene)["a/onboard"])
    assert draw_onboard(context, view, snapshot).title[1].endswith("no progress for 2.0 s")
