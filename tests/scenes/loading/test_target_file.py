"""Target files: a unit as scenes have it, or a map of tags; both become the geometry of perception."""

from __future__ import annotations

import math
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
import yaml

from msrr_perception.pose.target import TargetModel
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.pinhole import optical_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.loading.load import load_scene
from msrr_scenes.loading.tag_map_file import write_tag_map
from msrr_scenes.loading.target_file import read_target, target_scene
from msrr_scenes.specs.sensors import CalibrationSpec
from msrr_scenes.specs.tag_map import MappedTagSpec, TagMapSpec

CAMERA = {"hfov_deg": 75.0}

#: Poses of tags in the dock frame, upright: x into the tag, y left, z up. Tag 4 is the map's reference.
TAGS = {
    4: ((0.05, 0.0, 0.2), (0.0, 0.0, 0.0)),
    12: ((0.03, 0.1, 0.15), (0.02, -0.03, 0.6)),
    30: ((0.04, -0.12, 0.17), (0.0, 0.05, -0.5)),
}


def model(file: Path, data: object, calibration: CalibrationSpec | None = None) -> TargetModel:
    file.write_text(yaml.safe_dump(data, default_flow_style=True))
    folder = Path(tempfile.mkdtemp(dir=file.parent))  # geometry is cached by file
    scene = target_scene(read_target(file), file, folder, calibration)
    return TargetModel.from_scene(scene, scene.docks[0])


def write_map(file: Path, turned: float = 0.0) -> dict[int, SE3]:
    """Write the map of :data:`TAGS` in the frame of tag 4, and return their poses in D.

    All tags but tag 4 are turned in their plane by so much more [rad].
    """
    poses = {
        tag: (p, (roll + turned * (tag != 4), pitch, yaw)) for tag, (p, (roll, pitch, yaw)) in TAGS.items()
    }
    X_DT = {tag: optical_pose(SE3.from_xyz_rpy(*pose)) for tag, pose in poses.items()}
    tags = {}
    for tag, X in X_DT.items():
        X_MT = X_DT[4].inverse() @ X
        tags[tag] = MappedTagSpec(
            position_m=tuple(X_MT.p.tolist()), quaternion_xyzw=tuple(X_MT.quaternion_xyzw().tolist())
        )
    write_tag_map(file, TagMapSpec(family="tag36h11", tag_size_m=0.06, reference=4, tags=tags))
    return X_DT


def test_a_unit_is_told_as_in_a_scene(tmp_path: Path) -> None:
    scene = load_scene("close_range")
    step = scene.docks[0]
    right = TargetModel.from_scene(scene, step)
    unit = {"number": scene.units[step.target_unit].number, "port": step.target_port}
    own = model(tmp_path / "pair.yaml", {"unit": unit, "camera": CAMERA, "as_built": "careful"})
    assert own.port_tags == right.port_tags
    assert own.edges == right.edges
    assert own.tolerances == right.tolerances
    for tag, corners in right.corners_D.items():
        np.testing.assert_array_equal(own.corners_D[tag], corners)
    np.testing.assert_array_equal(own.X_UC.p, right.X_UC.p)


def test_mapped_tags_are_where_the_map_and_the_place_of_the_port_put_them(tmp_path: Path) -> None:
    X_DT = write_map(tmp_path / "map.yaml")
    dock = {"x_m": -0.05, "z_m": -0.2}
    own = model(tmp_path / "wall.yaml", {"marker": {"map": "map.yaml", "dock": dock}, "camera": CAMERA})
    assert own.tags == own.port_tags == (4, 12, 30)
    for tag, X in X_DT.items():
        np.testing.assert_allclose(own.corners_D[tag], X.act(tag_corners(0.06)), atol=1e-9)
    assert [edge.tag_id for edge in own.edges] == [12, 30]  # the outermost: left, right
    some = {"map": "map.yaml", "dock": dock, "tags": [30]}
    assert model(tmp_path / "wall.yaml", {"marker": some, "camera": CAMERA}).tags == (30,)


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_tags_glued_on_their_side_have_the_same_outermost_edges(quarters: int, tmp_path: Path) -> None:
    """The line of sight went from the middle of one such tag to that of the other."""
    edges = []
    for turned in (0.0, 0.5 * math.pi * quarters):
        write_map(tmp_path / "map.yaml", turned)
        own = model(tmp_path / "wall.yaml", {"marker": {"map": "map.yaml"}, "camera": CAMERA})
        edges.append(own.edge_points_D)
    np.testing.assert_allclose(edges[1], edges[0], atol=2e-3)  # tags that lean stand a little elsewhere


def test_a_fixture_is_no_unit_of_a_scene(tmp_path: Path) -> None:
    write_map(tmp_path / "map.yaml")
    model(tmp_path / "wall.yaml", {"marker": {"map": "map.yaml"}, "camera": CAMERA})
    (urdf,) = tmp_path.rglob("target.urdf")
    with pytest.raises(
        SceneError, match=r"units\.b\.urdf: .*target\.urdf: a fixture, for target files alone"
    ):
        load_scene("close_range", {"units.b.urdf": str(urdf)})


def test_the_mount_of_the_camera_and_its_calibration_can_be_given(tmp_path: Path) -> None:
    mount = {"x_m": 0.02, "z_m": 0.3, "pitch_deg": 10.0, "yaw_deg": 5.0}
    told = CalibrationSpec(fx_px=700.0, fy_px=710.0, cx_px=401.0, cy_px=299.0, width_px=800, height_px=600)
    data = {"unit": {"number": 1, "port": "rear"}, "robot": {"camera": mount}}
    own = model(tmp_path / "t.yaml", data, told)
    X_UB = SE3.from_xyz_rpy([0.02, 0.0, 0.3], [0.0, math.radians(10.0), math.radians(5.0)])
    np.testing.assert_allclose(own.X_UC.matrix(), optical_pose(X_UB).matrix(), atol=1e-12)
    assert own.camera.focal == 700.0
    assert (own.camera.width, own.camera.height) == (800, 600)
    assert own.wheel_radius > 0.0


def test_the_target_files_of_the_page_can_be_used(tmp_path: Path) -> None:
    """The first two name a calibration, the second one a map; the third tells what a shipped scene does."""
    page = Path(__file__).parents[3] / "docs" / "how-to" / "recordings.md"
    examples = re.findall(r"```yaml\n(.*?)```", page.read_text(), re.DOTALL)
    assert len(examples) == 3
    (tmp_path / "runs" / "map").mkdir(parents=True)
    tags = {
        tag: MappedTagSpec(position_m=(0.1 * tag, 0.0, 0.0), quaternion_xyzw=(0, 0, 0, 1)) for tag in range(8)
    }
    tag_map = TagMapSpec(family="tag36h11", tag_size_m=0.05, reference=4, tags=tags)
    write_tag_map(tmp_path / "runs" / "map" / "map.yaml", tag_map)
    (tmp_path / "camera.yaml").write_text(
        "{image_width: 800, image_height: 600,"
        " distortion_coefficients: {rows: 1, cols: 4, data: [0, 0, 0, 0]},"
        " camera_matrix: {rows: 3, cols: 3, data: [700, 0, 400, 0, 700, 300, 0, 0, 1]}}"
    )
    drawn, mapped, trial = (model(tmp_path / "t.yaml", yaml.safe_load(text)) for text in examples)
    assert len(drawn.port_tags) == 3
    assert mapped.tags == (4, 5, 6)
    assert drawn.camera.width == mapped.camera.width == 800
    scene = load_scene("close_range")
    own = TargetModel.from_scene(scene, scene.docks[0])
    assert (trial.lens, trial.corner_errors) == (own.lens, own.corner_errors)
    assert (trial.tolerances, trial.tag_family) == (own.tolerances, own.tag_family)


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ({"unit": {"number": 1, "port": "rear"}}, "nothing tells of the camera.*hfov_deg"),
        ({"unit": {"number": 1, "port": "top"}, "camera": CAMERA}, r"t\.yaml:\d+:\d+: unit\.port: 'top' is"),
        ({"camera": CAMERA}, "expected either unit or marker"),
        ({"unit": {"nmber": 1, "port": "rear"}}, r"t\.yaml:1:9: unit\.nmber: unknown key.*'number'"),
        ({"marker": {"map": "nowhere.yaml"}}, r"marker\.map: no file 'nowhere\.yaml' beside the file"),
        ({"marker": {"map": "map.yaml", "tags": [4, 5]}}, "tags 5 are not in the map, which has 4, 12, 30"),
        (
            {"unit": {"number": 1, "port": "rear"}, "robot": {"urdf": "none.urdf"}},
            r"t\.yaml:\d+:\d+: robot\.urdf: no URDF named",
        ),
        (
            {"unit": {"number": 1, "port": "rear"}, "robot": {"port": "frnt"}},
            r"t\.yaml:\d+:\d+: robot\.port: 'frnt' is no port of unit\.urdf; did you mean 'front'\?",
        ),
        (
            {"unit": {"number": 1, "port": "rear", "tag_ids": {"port_rear_marker": 3}}},
            r"t\.yaml:\d+:\d+: unit\.tag_ids\.port_rear_marker: no such tag link",
        ),
        *(
            ({"marker": {"map": "map.yaml"}, key: value}, rf"t\.yaml:\d+:\d+: {place}: changes nothing")
            for key, value, place in (
                ("control", {"docking": "c1"}, r"control\.docking"),
                ("as_built", {"onboard": {"yaw_deg": 1.0}}, r"as_built\.onboard\.yaw_deg"),
                ("tags", {"side_m": 0.1}, "tags"),
                ("los", {"setback_m": 0.1}, r"los\.setback_m"),
            )
        ),
    ],
)
def test_mistakes_are_answered_with_place_and_mend(tmp_path: Path, data: object, text: str) -> None:
    write_map(tmp_path / "map.yaml")
    file = tmp_path / "t.yaml"
    with pytest.raises(SceneError, match=text):
        model(file, data)
