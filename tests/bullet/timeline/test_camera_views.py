"""Camera frames as far as they were read."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.timeline.camera_views import (
    UNREAD,
    CameraView,
    docking_views,
    evenly_spaced,
    pinhole_camera,
    read_camera_views,
    read_exposures,
)
from msrr_perception.pose.overhead_model import OVERHEAD
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Exposure


def test_a_mosaic_holds_the_windows_and_a_mask_of_them(short_log):
    camera = short_log.header.scene.cameras.onboard.pinhole
    pixels = np.full((4, 5), 7, dtype=np.uint8)
    view = CameraView(Exposure("a/onboard", 0, 0), camera, [(Window(2, 3, 5, 4), pixels)])
    frame, read = view.mosaic()
    assert (frame[3:7, 2:7] == 7).all()
    assert read.sum() == 20
    assert (frame[~read] == UNREAD).all()


def test_views_are_those_of_the_exposures_asked_for(short_log):
    wanted = read_exposures(short_log)[10:40:7]
    views = list(read_camera_views(short_log, wanted))
    assert [view.exposure for view in views] == wanted
    assert any(view.tags for view in views)
    assert all(view.camera == pinhole_camera(short_log.header.scene, view.exposure.camera) for view in views)


def test_docking_views_are_onboard_frames_with_tags(short_log):
    views = docking_views(short_log, 3)
    assert len(views) == 3
    assert all(view.tags and view.exposure.camera == "a/onboard" for view in views)


def test_evenly_spaced_exposures_include_both_ends():
    exposures = [Exposure("a/onboard", i, i) for i in range(10)]
    assert [e.frame for e in evenly_spaced(exposures, 4)] == [0, 3, 6, 9]
    assert evenly_spaced(exposures, 20) == exposures
    assert evenly_spaced([], 3) == []


def test_a_scene_without_an_overhead_camera_has_no_model_of_it():
    with pytest.raises(SceneError, match="no overhead camera"):
        pinhole_camera(load_scene("close_range"), OVERHEAD)
