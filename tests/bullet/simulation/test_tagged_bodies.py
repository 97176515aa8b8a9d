"""Tags on units and obstacles: every slot and lid shows the tag of the scene, where perception expects it."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest

from msrr_bullet.built_poses import obstacle_tag_pose
from msrr_bullet.render.floor import Floor
from msrr_bullet.render.renderer import RenderContext
from msrr_bullet.render.tiny_renderer import TinyRenderer
from msrr_bullet.simulation.tag_plates import write_plate
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.as_built import BuiltTag
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import find_urdf, marker_links, read_unit, tag_corners
from msrr_scenes.specs.faults import MarkerHidden
from msrr_scenes.specs.scene import Scene

CAMERA = PinholeCamera(320, 240, 300.0)
GREY = Floor(lambda: np.full((1, 1), 100.0, dtype=np.float32), 1.0, 100.0)


def measured_marker() -> dict[str, object]:
    """The rear marker of unit number 1 with a left tag 3 mm and 2 degrees off its place in the drawing."""
    drawn = read_unit(find_urdf("unit.urdf"))
    first = 10 + drawn.tag_slots.index("port_rear_marker_left")
    X_UT = [drawn.frame(slot) for slot in marker_links("rear")]
    X_UT[0] = X_UT[0] @ SE3.from_xyz_rpy([0.003, 0.0, -0.001], [0.0, 0.035, 0.0])
    poses = {
        first + i: {"position_m": X.p.tolist(), "quaternion_xyzw": X.quaternion_xyzw().tolist()}
        for i, X in enumerate(X_UT)
    }
    return {"map": {"family": "tag36h11", "tag_size_m": 0.05, "reference": first, "tags": poses}}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "plates",
            "units": {
                "a": {"number": 1, "markers": {"rear": measured_marker()}},
                "b": {"number": 0, "tag_ids": {"tag_top": 400}},
            },
            "obstacles": {
                "post": {"shape": "cylinder", "radius_m": 0.06, "tag_id": 500},
                "crate": {"shape": "box", "length_m": 0.2, "width_m": 0.1},
            },
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


def look_at(X_WT: SE3, distance: float) -> SE3:
    """A camera straight in front of a tag, upright with it."""
    return X_WT @ SE3(np.eye(3), np.array([0.0, 0.0, -distance]))


def test_every_slot_of_two_units_shows_its_own_tag(client: int, scene: Scene, tmp_path: Path) -> None:
    renderer, tags = TinyRenderer(RenderContext(client, 2, GREY)), TagVisuals(scene, tmp_path)
    bodies = {
        "a": pybullet.loadURDF(str(tags.unit_urdf("a")), useFixedBase=True),
        "b": pybullet.loadURDF(str(tags.unit_urdf("b")), [0.0, 1.0, 0.0], useFixedBase=True),
    }
    for unit, body in bodies.items():
        tags.add_to_unit(client, body, unit)
    for unit, body in bodies.items():
        ids = scene.tag_ids(unit)
        assert len(set(ids.values())) == 10
        inertial = pybullet.getDynamicsInfo(body, -1)
        X_RI = SE3.from_quaternion_xyzw(inertial[3], inertial[4])
        X_WR = SE3.from_quaternion_xyzw(*pybullet.getBasePositionAndOrientation(body)) @ X_RI.inverse()
        for slot, tag_id in ids.items():
            X_WT = X_WR @ scene.geometry(unit).frame(slot)
            size = scene.tag_size(unit, slot)
            distance = 3.0 * size
            image = renderer.render(CAMERA, look_at(X_WT, distance), CAMERA.frame)
            detected = {t.tag_id: t for t in PupilDetector().detect(image, CAMERA.frame)}
            expected = CAMERA.project(tag_corners(size) + np.array([0.0, 0.0, distance]))
            np.testing.assert_allclose(detected[tag_id].corners, expected, atol=0.4, err_msg=f"{unit} {slot}")


def test_hidden_units_show_blank_plates(client: int, scene: Scene, tmp_path: Path) -> None:
    hidden = scene.model_copy(update={"faults": (MarkerHidden(kind="marker_hidden", unit="b"),)})
    tags = TagVisuals(hidden, tmp_path)
    body = pybullet.loadURDF(str(tags.unit_urdf("b")), useFixedBase=True)
    tags.add_to_unit(client, body, "b")
    top = SE3.from_xyz_rpy([0.0, 0.0, 0.2305], [np.pi, 0.0, 0.0])
    image = TinyRenderer(RenderContext(client, 2, GREY)).render(CAMERA, look_at(top, 0.4), CAMERA.frame)
    assert PupilDetector().detect(image, CAMERA.frame) == ()
    middle = image[100:140, 140:180]
    assert middle.min() > 150, "a blank plate is white"
    assert np.ptp(middle) <= 1


def test_files_named_relative_to_the_urdf_are_still_found(scene: Scene, tmp_path: Path, client: int) -> None:
    """A user's URDF with a mesh of its own, given by a relative path."""
    home, folder = tmp_path / "home", tmp_path / "trial"
    home.mkdir()
    folder.mkdir()
    for file in write_plate(home, None):
        file.replace(home / f"shell{file.suffix}")
    tree = ElementTree.parse(scene.geometry("a").urdf)
    visual = ElementTree.SubElement(tree.getroot().find("link"), "visual")
    ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), "mesh", filename="shell.obj")
    tree.write(home / "mine.urdf")
    own = scene.model_copy(
        update={
            "source": home / "scene.yaml",
            "units": {"a": scene.units["a"].model_copy(update={"urdf": "mine.urdf"})},
        }
    )
    tags = TagVisuals(own, folder)
    urdf = tags.unit_urdf("a")
    names = [m.attrib["filename"] for m in ElementTree.parse(urdf).iter("mesh")]
    assert str((home / "shell.obj").resolve()) in names
    assert all(Path(name).is_absolute() and Path(name).is_file() for name in names)
    body = pybullet.loadURDF(str(urdf))
    tags.add_to_unit(client, body, "a")


def test_a_tag_without_a_link_is_refused(scene: Scene, tmp_path: Path, client: int) -> None:
    wrong = scene.model_copy(
        update={"units": {"a": scene.units["a"].model_copy(update={"tag_ids": {"nose": 77}})}}
    )
    with pytest.raises(GeometryError, match="nose"):
        TagVisuals(wrong, tmp_path).unit_urdf("a")
    bare = pybullet.createMultiBody(0.0)
    with pytest.raises(GeometryError, match="tag_top"):
        TagVisuals(scene, tmp_path).add_to_unit(client, bare, "a")


def test_the_tag_of_an_obstacle_lies_on_its_lid_and_an_obstacle_without_a_tag_gets_none(
    client: int, scene: Scene, tmp_path: Path
) -> None:
    X_WO, tags = SE2(0.3, -0.4, 0.7), TagVisuals(scene, tmp_path)
    tags.add_to_obstacle(client, "crate", SE2())
    assert pybullet.getNumBodies(physicsClientId=client) == 0
    tags.add_to_obstacle(client, "post", X_WO)
    spec = scene.obstacles["post"]
    X_WT = SE3.from_se2(X_WO) @ obstacle_tag_pose(spec.height_m, BuiltTag())
    image = TinyRenderer(RenderContext(client, 2, GREY)).render(CAMERA, look_at(X_WT, 0.3), CAMERA.frame)
    (tag,) = PupilDetector().detect(image, CAMERA.frame)
    assert tag.tag_id == 500
    expected = CAMERA.project(tag_corners(spec.tag_m) + np.array([0.0, 0.0, 0.3]))
    np.testing.assert_allclose(tag.corners, expected, atol=0.4)
