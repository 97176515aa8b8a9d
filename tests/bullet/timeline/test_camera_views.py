"""Camera frames as far as they were read."""

from __future__ import annotations

import numpy as np

from msrr_bullet.log.records import CameraWindow
from msrr_bullet.timeline.camera_views import (
    UNREAD,
    CameraView,
    CameraViewCollector,
    docking_views,
    evenly_spaced,
    read_camera_views,
    read_exposures,
)
from msrr_scenes.camera_lenses import camera_lenses
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import OVERHEAD, Exposure


def test_a_mosaic_holds_the_windows_and_a_mask_of_them(short_log):
    lens = short_log.header.scene.cameras.onboard.lens
    pixels = np.full((4, 5), 7, dtype=np.uint8)
    view = CameraView(Exposure("a/onboard", 0, 0), lens, [(Window(2, 3, 5, 4), pixels)])
    frame, read = view.mosaic()
    assert (frame[3:7, 2:7] == 7).all()
    assert read.sum() == 20
    assert (frame[~read] == UNREAD).all()


def test_a_running_trial_gives_the_views_of_its_log(short_log):
    collector, live = CameraViewCollector(short_log.header.scene), []
    for record in short_log.records("/camera/*", "/perception/*", end_ns=3_000_000_000):
        if record.kind is CameraWindow:
            read = record.message
            collector.add_window(read.exposure, read.window, read.pixels)
        else:
            view = collector.add(record.message)
            live += [] if view is None else [view]
    logged = {v.exposure: v for v in read_camera_views(short_log, [v.exposure for v in live])}
    assert len(live) == len(logged) > 10
    for view in live:
        assert view.lens == logged[view.exposure].lens
        for (a, pixels), (b, same) in zip(view.windows, logged[view.exposure].windows, strict=True):
            assert a == b
            assert (pixels == same).all()
        for tag, same in zip(view.tags, logged[view.exposure].tags, strict=True):
            assert tag.tag_id == same.tag_id
            assert (tag.corners == same.corners).all()


def test_a_mosaic_is_undistorted():
    """A dot in the frame appears where the ideal camera sees it, and what no lens shows counts as unread."""
    lens = Lens(PinholeCamera(640, 480, 417.0, (5.0, -3.0)), Distortion(k1=0.2, k2=-0.02, aspect=0.98))
    pixels = np.full((480, 640), 40, dtype=np.uint8)
    pixels[99:102, 149:152] = 255
    frame, read = CameraView(Exposure("a/onboard", 0, 0), lens, [(lens.camera.frame, pixels)]).mosaic()
    x, y = lens.undistorted(np.array([[150.0, 100.0]]))[0]
    rows, columns = np.nonzero((frame > 100) & read)
    assert np.hypot(columns.mean() - x, rows.mean() - y) < 0.6
    assert not read[0, 0]
    assert (frame[~read] == UNREAD).all()


def test_views_are_those_of_the_exposures_asked_for(short_log):
    wanted = read_exposures(short_log)[10:40:7]
    views = list(read_camera_views(short_log, wanted))
    assert [view.exposure for view in views] == wanted
    assert any(view.tags for view in views)
    assert all(view.lens == camera_lenses(short_log.header.scene)[view.exposure.camera] for view in views)


def test_docking_views_are_onboard_frames_with_tags(short_log):
    views = docking_views(short_log)
    assert len(views) == 3
    assert all(view.tags and view.exposure.camera == "a/onboard" for view in views)


def test_evenly_spaced_exposures_include_both_ends():
    exposures = [Exposure("a/onboard", i, i) for i in range(10)]
    assert [e.frame for e in evenly_spaced(exposures, 4)] == [0, 3, 6, 9]
    assert evenly_spaced(exposures, 10**12) == exposures
    assert evenly_spaced([], 3) == []


def test_a_scene_has_a_lens_for_every_camera_that_there_is():
    assert set(camera_lenses(load_scene("close_range"))) == {"a/onboard", "b/onboard"}
    assert set(camera_lenses(load_scene("two_units"))) == {"a/onboard", "b/onboard", OVERHEAD}
