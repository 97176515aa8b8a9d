"""Markers that were measured: a scene takes the map of its tags, and says what does not fit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from msrr_perception.pose.target import TargetModel
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import marker_links, tag_corners
from msrr_scenes.loading.load import load_scene, scene_hash
from msrr_scenes.loading.tag_map_file import write_tag_map
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.tag_map import MappedTagSpec, TagMapSpec

#: How the left tag of the marker was built against the drawing, in its own frame.
BUILT = SE3.from_xyz_rpy([0.001, -0.0005, 0.0008], [0.0, 0.02, 0.01])
LEFT, MIDDLE, _ = SLOTS = marker_links("rear")


def scene_file(folder: Path, markers: str = "{rear: map.yaml}", mast_m: float = 0.05) -> Path:
    """A scene with a marker of three tags of 50 mm."""
    file = folder / "own.yaml"
    file.write_text(
        f"units:\n  b: {{number: 1, markers: {markers}}}\n"
        "  a: {number: 0, pose: {frame: b.rear, x_m: -0.5}}\n"
        f"plan: [{{unit: a, to: b.rear}}]\ntags: {{mast_m: {mast_m}}}\n"
    )
    return file


def measured(folder: Path, **changes: object) -> None:
    """Write the map of the marker of ``b.rear``, in the frame of its right tag."""
    drawn = load_scene(scene_file(folder, "{}"))
    ids, geometry = drawn.tag_ids("b"), drawn.geometry("b")
    X_MU = geometry.frame(SLOTS[2]).inverse()
    tags = {}
    for slot in SLOTS:
        X_MT = X_MU @ geometry.frame(slot) @ (BUILT if slot == LEFT else SE3())
        pose = {"position_m": tuple(X_MT.p), "quaternion_xyzw": tuple(X_MT.quaternion_xyzw())}
        tags[ids[slot]] = MappedTagSpec(**pose, covariance=(1e-6,) * 36)
    content = {"family": "tag36h11", "tag_size_m": 0.05, "reference": ids[SLOTS[2]], "tags": tags}
    write_tag_map(folder / "map.yaml", TagMapSpec.model_validate(content | changes))


def test_everybody_is_told_where_the_tags_are(tmp_path: Path) -> None:
    """The tags of other ports stay as designed, and so does the one that holds the map."""
    measured(tmp_path)
    scene, drawn = load_scene(scene_file(tmp_path)), load_scene(scene_file(tmp_path, "{}"))
    before = drawn.geometry("b")
    X_UL = before.frame(LEFT) @ BUILT
    for geometry in (scene.geometry("b"), draw_as_built(scene, 1).units["b"].geometry):
        np.testing.assert_allclose(geometry.frame(LEFT).matrix(), X_UL.matrix(), atol=1e-9)
        for slot in set(geometry.tag_slots) - {LEFT}:
            np.testing.assert_allclose(geometry.frame(slot).matrix(), before.frame(slot).matrix(), atol=1e-9)
    assert scene.geometry("b") is scene.geometry("b")
    target = TargetModel.from_scene(scene, scene.docks[0])
    X_DU = SE3.from_se2(before.dock_frame("rear")).inverse()
    corners = (X_DU @ X_UL).act(tag_corners(0.05))
    np.testing.assert_allclose(target.corners_D[scene.tag_ids("b")[LEFT]], corners, atol=1e-9)


def test_the_anchor_stays_and_the_others_follow(tmp_path: Path) -> None:
    measured(tmp_path)
    scene = load_scene(scene_file(tmp_path, "{rear: {map: map.yaml, anchor: left}}"))
    drawn = load_scene(scene_file(tmp_path, "{}")).geometry("b")
    assert scene.geometry("b").frame(LEFT) is drawn.frame(LEFT)
    X_LM = scene.geometry("b").frame(LEFT).inverse() @ scene.geometry("b").frame(MIDDLE)
    expected = (drawn.frame(LEFT) @ BUILT).inverse() @ drawn.frame(MIDDLE)
    np.testing.assert_allclose(X_LM.matrix(), expected.matrix(), atol=1e-9)


def test_a_log_needs_no_file(tmp_path: Path) -> None:
    measured(tmp_path)
    scene = load_scene(scene_file(tmp_path))
    digest = scene_hash(scene)
    assert digest != scene_hash(load_scene(scene_file(tmp_path, "{}")))
    (tmp_path / "map.yaml").unlink()
    again = Scene.model_validate(json.loads(scene.model_dump_json()))
    assert scene_hash(again) == digest
    np.testing.assert_array_equal(
        again.geometry("b").frame(LEFT).matrix(), scene.geometry("b").frame(LEFT).matrix()
    )


@pytest.mark.parametrize(
    ("markers", "mast_m", "changes", "message"),
    [
        ("{reer: map.yaml}", 0.05, {}, r"markers\.reer: no port with a marker; did you mean 'rear'\?"),
        ("{front: map.yaml}", 0.05, {}, r"markers\.front: no port with a marker.* Ports with one: rear"),
        ("{rear: none.yaml}", 0.05, {}, r"markers\.rear: no file 'none\.yaml' beside the file"),
        ("{left: map.yaml}", 0.05, {}, r"markers\.left\.map: the map has no tag 1\d \(left\), .*; it has 1"),
        (
            "{rear: map.yaml}",
            0.05,
            {"family": "tag25h9"},
            "of tag25h9 tags, and those of this scene are tag36h11",
        ),
        ("{rear: {anchor: left}}", 0.05, {}, r"markers\.rear\.map: required"),
        (
            "{rear: {map: map.yaml, anchor: top}}",
            0.05,
            {},
            r"anchor: no tag 'top' of .* left, middle",
        ),
        (
            "{rear: {map: map.yaml, dock: {}}}",
            0.05,
            {},
            r"rear\.dock: the URDF has tags of this port",
        ),
        (
            "{rear: {map: map.yaml, anchor: left, dock: {}}}",
            0.05,
            {},
            r"rear\.anchor: changes nothing beside dock",
        ),
    ],
)
def test_what_does_not_fit_is_said(
    tmp_path: Path, markers: str, mast_m: float, changes: dict[str, object], message: str
) -> None:
    measured(tmp_path, **changes)
    with pytest.raises(SceneError, match=message) as refused:
        load_scene(scene_file(tmp_path, markers, mast_m))
    assert "own.yaml:2:" in str(refused.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("family: tag36h11", r"1:1: tag_size_m: required, and missing; expected a map of tags"),
        ("tag_size_m: 5 cm", r"1:1: tag_size_m: expected a number, found '5 cm'; expected a map"),
        ("references: 11", r"1:1: references: unknown key; did you mean 'reference'\?.* expected a map"),
        (
            "{family: tag36h11, tag_size_m: 0.05, tags: {}, reference: 11}",
            r"1:48: reference: the map has no tag 11, in whose frame it is",
        ),
    ],
)
def test_a_file_that_is_no_map_is_refused(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "map.yaml").write_text(f"{content}\n")
    with pytest.raises(SceneError, match=rf"markers\.rear: .*map\.yaml:{message}"):
        load_scene(scene_file(tmp_path))


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"units.b.frames": "{camera: nowhere}"}, r"units\.b\.frames\.camera: .* no link 'nowhere'"),
        ({"units.b.urdf": "none.urdf"}, r"units\.b\.urdf: no URDF named 'none\.urdf'"),
    ],
)
def test_of_a_robot_that_cannot_be_read_that_is_said_and_nothing_of_its_markers(
    overrides: dict[str, str], message: str, tmp_path: Path
) -> None:
    measured(tmp_path)
    with pytest.raises(SceneError, match=message) as refused:
        load_scene(scene_file(tmp_path), overrides)
    assert "markers" not in str(refused.value)
