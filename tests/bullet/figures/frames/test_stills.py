"""Stills: which frames they are of, and what they show."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import cv2
import numpy as np

from msrr_bullet.figures.frames import stills
from msrr_bullet.figures.frames.frame_files import FrameAnnotator
from msrr_bullet.timeline.camera_views import read_camera_views, read_exposures
from msrr_scenes.messages import Exposure


def test_a_still_shows_the_annotated_frame_of_its_instant(short_log, short_snapshots, monkeypatch):
    monkeypatch.setattr(stills, "MAX_STILLS", 6)
    drawn = stills.draw_stills(short_log, short_snapshots)
    assert 4 <= len(drawn) <= 6
    assert {still.camera for still in drawn} == {"overhead", "a/onboard"}
    stamps = {(still.camera, still.stamp_ns): still for still in drawn}
    exposures = [e for e in read_exposures(short_log) if (e.camera, e.stamp_ns) in stamps]
    annotator = FrameAnnotator(short_log, short_snapshots)
    for view in read_camera_views(short_log, exposures[:2]):
        still, frame = stamps[view.exposure.camera, view.stamp_ns], annotator.draw(view)
        image = cv2.imdecode(np.frombuffer(still.data, dtype=np.uint8), cv2.IMREAD_COLOR)
        small = cv2.resize(frame.image, (640, 480), interpolation=cv2.INTER_AREA)
        assert image.shape == small.shape
        assert np.abs(image.astype(float) - small).mean() < 4.0  # grey levels; what the compression loses
        assert still.text == frame.title[-1]


def test_exposures_are_thinned_to_the_rate_and_the_number_of_all_cameras():
    many = [Exposure(camera, k, k * 50_000_000) for k in range(1200) for camera in ("overhead", "a/onboard")]
    few = stills._select(many)
    assert 0.8 * stills.MAX_STILLS < len(few) <= stills.MAX_STILLS
    assert len(set(Counter(e.camera for e in few).values())) == 1
    short = stills._select(many[:80])  # 2 s
    intervals = [int(e.stamp_ns * stills.STILL_RATE / 1e9) for e in short if e.camera == "overhead"]
    assert len(set(intervals)) == len(intervals) == 2 * stills.STILL_RATE  # one in each
    assert all(a.stamp_ns <= b.stamp_ns for a, b in pairwise(e for e in few if e.camera == "overhead"))
    assert stills._select([]) == []
