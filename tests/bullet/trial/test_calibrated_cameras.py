"""Trials whose cameras distort as everybody is told: they dock as those of ideal cameras do."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from msrr_bullet.log import LogHeader
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

ONBOARD = {
    "cameras.onboard.calibration": (
        "{fx_px: 417, fy_px: 410, cx_px: 328, cy_px: 233, k1: -0.2, k2: 0.04, p1: 0.001, p2: -0.0005}"
    )
}
OVERHEAD = {
    "cameras.overhead.calibration": "{fx_px: 967, fy_px: 960, cx_px: 650, cy_px: 470, k1: -0.2, k2: 0.05}"
}


def contact_mm(result: TrialResult) -> float:
    contact = result.steps[0].contact
    assert contact is not None
    return 1e3 * abs(contact.lateral_m)


@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(1, 12), marks=pytest.mark.nightly)], ids=str)
def test_a_unit_docks_behind_a_lens_that_it_knows(seeds: range, shipped: Callable[..., Scene]) -> None:
    """Units with ideal cameras touch the port within 0.1 mm."""
    for seed in seeds:
        result = Trial(shipped("close_range", ONBOARD), seed).run()
        assert result.outcome is Outcome.DOCKED
        assert contact_mm(result) < 0.1


@pytest.mark.parametrize("seed", [101, pytest.param(103, marks=pytest.mark.nightly)])
def test_a_unit_in_poor_light_keeps_its_port_in_sight_as_it_turns(
    seed: int, shipped: Callable[..., Scene]
) -> None:
    """At an exposure time of 80 ms a tag in 0.75 m is smeared beyond recognition at 0.2 rad/s."""
    camera = {"exposure_ms": "80", "rate_hz": "12", "latency_ms": "60"}
    values = {f"cameras.onboard.{key}": value for key, value in camera.items()}
    result = Trial(shipped("close_range", {"as_built": "careful", **values}), seed).run()
    assert result.outcome is Outcome.DOCKED
    assert len(result.steps[0].attempts) == 1


def test_clients_see_tags_where_the_image_of_the_lens_shows_them(
    tmp_path: Path, shipped: Callable[..., Scene]
) -> None:
    """Found again in the images of the log; perception itself has the corners of an ideal camera."""
    scene = shipped("close_range", {**ONBOARD, "time_limit_s": "1"})
    with McapRecorder(tmp_path / "t.mcap", LogHeader.of(scene, 1, {})) as recorder:
        Trial(scene, 1, recorder=recorder).run()
    shown, found, named = {}, {}, ["/camera/a/onboard/image", "/camera/a/onboard/annotations"]
    with (tmp_path / "t.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(named):
            stamp = message.timestamp.seconds, message.timestamp.nanos
            if channel.topic == named[1]:
                shown |= {(stamp, text.text): (text.position.x, text.position.y) for text in message.texts}
                continue
            image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_GRAYSCALE)
            tags = PupilDetector().detect(image, Window(0, 0, 640, 480))
            found |= {(stamp, str(tag.tag_id)): tuple(tag.corners[0]) for tag in tags}
    both = shown.keys() & found.keys()
    assert len(both) >= 20
    assert max(math.dist(shown[key], found[key]) for key in both) < 0.5


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(4))
def test_a_mission_is_led_by_cameras_that_distort(
    seed: int, shipped: Callable[..., Scene], tmp_path: Path
) -> None:
    """And a replay, which has the calibration from the log, finds the same."""
    scene = shipped("two_units", ONBOARD | OVERHEAD)
    with McapRecorder(tmp_path / "trial.mcap", LogHeader.of(scene, seed, {})) as recorder:
        result = Trial(scene, seed, recorder=recorder).run()
    assert result.outcome is Outcome.DOCKED
    assert contact_mm(result) < 0.1
    assert replay(tmp_path).identical
