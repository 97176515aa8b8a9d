"""Messages and coordinate frames as Foxglove reads them."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from msrr_bullet.log import LOG_NAME, Event, Level, LogHeader, StepStart, topics
from msrr_bullet.log.display import DisplayMessages
from msrr_bullet.log.frame_tree import scene_frames
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.trial.trial import Trial
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import (
    OVERHEAD,
    Detections,
    Exposure,
    Localisation,
    PoseEstimate,
    TagDetection,
    WheelOdometry,
)
from msrr_scenes.specs.scene import Scene
from tests.bullet.log.conftest import record_trial


def test_clients_get_messages_in_the_schemas_of_foxglove(tmp_path: Path, header: LogHeader) -> None:
    """The decoder goes by the schemas in the file, as every client does."""
    with McapRecorder(tmp_path / "t.mcap", header) as recorder:
        recorder.write(topics.STEPS, 0, StepStart(0, 0, "a"))
        record_trial(recorder, 0.1)
        recorder.write(topics.EVENTS, 5, Event(1_500_000_000, "trial", "contact", Level.WARNING))
    shown = []
    with (tmp_path / "t.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
            if decode is not None:
                shown.append((channel.topic, schema.name, decode(message.data)))
    kinds = {topic: name for topic, name, _ in shown}
    assert kinds == {
        "/tf": "foxglove.FrameTransforms",
        "/scene": "foxglove.SceneUpdate",
        "/scene/estimates": "foxglove.SceneUpdate",
        "/log": "foxglove.Log",
        "/joint_states/a": "foxglove.JointStates",
        "/perception/a/pose": "foxglove.PoseInFrame",
        "/camera/a/onboard/image": "foxglove.CompressedImage",
        "/camera/a/onboard/annotations": "foxglove.ImageAnnotations",
        **{f"/camera/{unit}/onboard/calibration": "foxglove.CameraCalibration" for unit in "ab"},
    }
    (line,) = (message for topic, _, message in shown if topic == "/log")
    assert (line.timestamp.seconds, line.timestamp.nanos) == (1, 500_000_000)
    assert (line.message, line.name, line.level) == ("contact", "trial", 3)
    images = [message for topic, _, message in shown if topic.endswith("image")]
    assert [round(1e-6 * message.timestamp.nanos) for message in images] == [0, 40, 80]
    assert all(
        cv2.imdecode(np.frombuffer(m.data, np.uint8), cv2.IMREAD_GRAYSCALE).shape == (480, 640)
        for m in images
    )
    marked = [message for topic, _, message in shown if topic.endswith("annotations")]
    assert [(len(m.points), [t.text for t in m.texts]) for m in marked] == [(2, ["11"])] * 3
    children = Counter(t.child_frame_id for topic, _, m in shown if topic == "/tf" for t in m.transforms)
    assert {"a", "a/onboard", "b.rear"} <= children.keys()
    assert {count for frame, count in children.items() if frame != "a"} == {1}
    entities = {e.id: e for topic, _, m in shown if topic.startswith("/scene") for e in m.entities}
    assert {"a", "b", "a/estimate"} == entities.keys()
    assert len(entities["a"].cubes) + len(entities["a"].spheres) == len(header.scene.geometry("a").solids)


def test_the_tree_holds_ports_and_cameras() -> None:
    scene = load_scene("two_units")
    links = {(link.parent, link.child): link.X for link in scene_frames(scene).links}
    assert {("b", "b.rear"), ("a", "a/onboard"), ("world", "overhead")} <= links.keys()
    # The overhead camera looks straight down.
    np.testing.assert_allclose(links["world", "overhead"].R[:, 2], [0.0, 0.0, -1.0], atol=1e-12)


def test_an_estimate_stays_in_the_frame_of_its_port(tmp_path: Path, shipped: Callable[..., Scene]) -> None:
    """Frames have one parent for all times: clients would draw a first estimate at a second port."""
    scene, estimate = shipped("assemble_line"), PoseEstimate(0, SE2(-0.5, 0.0, 0.0), np.eye(3), 0)
    with McapRecorder(tmp_path / "t.mcap", LogHeader.of(scene, 1, {})) as recorder:
        for now, port in ((0, "b.rear"), (1_000_000_000, "c.rear")):
            recorder.write(topics.STEPS, now, StepStart(now, 0, "a", "front", port))
            recorder.write(topics.estimate("a"), now, estimate)
    parents, frames = defaultdict(set), []
    with (tmp_path / "t.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
            if channel.topic == "/tf":
                for link in decode(message.data).transforms:
                    parents[link.child_frame_id].add(link.parent_frame_id)
            elif channel.topic == "/perception/a/pose":
                frames.append(decode(message.data).frame_id)
            elif channel.topic == "/scene/estimates":
                frames += [entity.frame_id for entity in decode(message.data).entities]
    assert all(len(known) == 1 for known in parents.values())
    assert frames == ["b.rear", "b.rear", "c.rear", "c.rear"]
    assert {"b.rear", "c.rear"} <= parents.keys()


def test_joint_states_are_those_of_the_joints_of_the_urdf(
    tmp_path: Path, shipped: Callable[..., Scene]
) -> None:
    """The axis of the right wheel of the round robot points to the right: its joint turns backward."""
    scene = shipped("round_robots")
    unit = next(iter(scene.units))
    with McapRecorder(tmp_path / "t.mcap", LogHeader.of(scene, 1, {})) as recorder:
        recorder.write(f"/sensors/{unit}/odometry", 0, WheelOdometry(unit, 0, 0.25, -0.5))
    with (tmp_path / "t.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        (state,) = [m.decoded_message for m in reader.iter_decoded_messages([topics.joint_states(unit)])]
    assert {joint.name: joint.position for joint in state.joints} == {
        "left_wheel_joint": 0.25,
        "right_wheel_joint": 0.5,
    }


def test_the_layout_names_topics_that_logs_have(short_run: Path) -> None:
    """``docs/reference/foxglove_layout.json`` is of trials with both cameras and a unit ``a`` that docks."""
    layout = (Path(__file__).parents[3] / "docs" / "reference" / "foxglove_layout.json").read_text()
    named = set(re.findall(r'"(/[\w/]+)', layout))
    with (short_run / LOG_NAME).open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    of_missions = {topics.DRAWN_ROUTES}
    assert named - of_missions <= {channel.topic for channel in summary.channels.values()}
    assert len(named) >= 8


@pytest.mark.parametrize(
    ("name", "time_limit_s", "topic", "drawn"),
    [
        ("late_obstacle", "4", topics.DRAWN_BODIES, {"a", "b", "post"}),
        ("assemble_cross", "1", topics.DRAWN_ROUTES, {f"{unit}/route" for unit in "abcdefgh"}),
    ],
)
def test_a_client_that_jumps_in_time_gets_all_that_is_drawn(
    name: str, time_limit_s: str, topic: str, drawn: set[str], shipped: Callable[..., Scene], tmp_path: Path
) -> None:
    """It clears its view, and takes the last message of each topic before the time to which it jumps."""
    scene = shipped(name, {"time_limit_s": time_limit_s}, blind=True)
    with McapRecorder(tmp_path / "t.mcap", LogHeader.of(scene, 1, {})) as recorder:
        Trial(scene, 1, recorder=recorder).run()
    last: dict[str, set[str]] = {}
    with (tmp_path / "t.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
            if decode is not None and channel.topic.startswith("/scene"):
                shown = {entity.id for entity in decode(message.data).entities}
                assert shown >= last.get(channel.topic, set())
                last[channel.topic] = shown
    assert last[topic] == drawn


def test_tags_of_a_localisation_service_are_shown_as_those_of_the_overhead_camera() -> None:
    """Nothing was drawn into the image of that camera."""
    shown = DisplayMessages(load_scene("biased_localisation"))
    corners = np.array([[10.0, 10.0], [30.0, 10.0], [30.0, 30.0], [10.0, 30.0]])
    found = Detections(Exposure(OVERHEAD, 3, 7), (TagDetection(5, corners),), ())
    (direct,) = shown.of(topics.sensor("a", found), 9, found)
    told = Localisation(found)
    (derived,) = shown.of(topics.sensor("a", told), 9, told)
    assert derived[:2] == direct[:2] == (topics.image_annotations(OVERHEAD), 9)
    assert derived[2].encode() == direct[2].encode()
