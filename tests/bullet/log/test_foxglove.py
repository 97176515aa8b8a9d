"""Messages and coordinate frames as Foxglove reads them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from msrr_bullet.log import (
    Event,
    FrameLink,
    FrameLinks,
    Level,
    LogHeader,
    McapRecorder,
    StepStart,
    topics,
)
from msrr_bullet.log.foxglove import scene_frames, step_frames
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.loading.load import load_scene

Record = Callable[..., None]


def test_well_known_messages_have_the_schemas_of_foxglove(
    tmp_path: Path, header: LogHeader, record_trial: Record
) -> None:
    with McapRecorder(tmp_path / "t.mcap", header) as recorder:
        record_trial(recorder, 0.1)
        recorder.write(topics.EVENTS, 5, Event(1_500_000_000, "trial", "contact", Level.WARNING))
        link = FrameLink("b", "a/target", SE3.from_xyz_rpy([0.1, 0.0, 0.0], [0.0, 0.0, math.pi]))
        recorder.write(topics.FRAMES, 5, FrameLinks(5, (link,)))
        recorder.write(topics.STEPS, 5, StepStart(5, 0, "a"))
    from mcap.reader import make_reader

    with (tmp_path / "t.mcap").open("rb") as file:
        reader = make_reader(file)
        seen = {c.topic: (s, json.loads(m.data)) for s, c, m in reader.iter_messages()}
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 10 + 3 * 5 + 3 * 3 + 5
    for topic, name in {
        "/truth/a/pose": "foxglove.FrameTransform",
        "/perception/a/estimate": "foxglove.PoseInFrame",
        "/camera/a/onboard/window": "foxglove.CompressedImage",
        "/events": "foxglove.Log",
        "/frames": "foxglove.FrameTransforms",
        "/plan/step": "msrr.StepStart",
    }.items():
        schema, value = seen[topic]
        assert (schema.name, schema.encoding) == (name, "jsonschema")
        properties = json.loads(schema.data)["properties"]
        assert set(value) == set(properties)
    assert seen["/events"][1]["timestamp"] == {"sec": 1, "nsec": 500_000_000}
    assert seen["/events"][1]["level"] == 3
    assert seen["/perception/a/estimate"][1]["frame_id"] == "a/target"
    assert seen["/frames"][1]["transforms"][0]["child_frame_id"] == "a/target"


def test_the_tree_holds_ports_and_cameras() -> None:
    scene = load_scene("two_units")
    links = {(link.parent, link.child): link.X for link in scene_frames(scene).links}
    assert {("b", "b.rear"), ("a", "a/onboard"), ("world", "overhead")} <= links.keys()
    # The overhead camera looks straight down.
    np.testing.assert_allclose(links["world", "overhead"].R[:, 2], [0.0, 0.0, -1.0], atol=1e-12)
    (target,) = step_frames(scene, StepStart(5, 0, "a")).links
    assert (target.parent, target.child) == ("b.rear", "a/target")
