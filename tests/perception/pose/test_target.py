from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.pose.target import TargetModel
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.control import LosSpec
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


def test_the_map_holds_every_tag_of_the_unit_in_the_dock_frame(scene: Scene, target: TargetModel) -> None:
    geometry, ids = scene.geometry("b"), scene.tag_ids("b")
    assert target.tags == tuple(sorted(ids.values()))
    X_UD = SE3.from_se2(geometry.dock_frame("rear"))
    for slot, tag in ids.items():
        middle = X_UD.act(target.corners_D[tag].mean(axis=0))
        np.testing.assert_allclose(middle, geometry.frame(slot).p, atol=1e-12)
        edges = np.linalg.norm(np.diff(target.corners_D[tag], axis=0), axis=1)
        np.testing.assert_allclose(edges, scene.tag_size("b", slot), atol=1e-12)


def test_the_port_tags_face_the_coming_unit_and_the_tags_left_is_left(target: TargetModel) -> None:
    for tag in target.port_tags:
        bottom_left, bottom_right, top_right, _ = target.corners_D[tag]
        into = np.cross(bottom_right - bottom_left, bottom_right - top_right)
        assert into[0] > 0.0  # z of T points into the tag, x of D into the unit
        assert bottom_left[1] > bottom_right[1]  # who looks along +x has +y on the left
        assert top_right[2] > bottom_right[2]


def test_the_los_edges_are_the_outer_black_edges(scene: Scene, target: TargetModel) -> None:
    for side, point in zip((1.0, -1.0), target.edge_points_D, strict=True):
        np.testing.assert_allclose(point[:2], [scene.los.setback_m, side * scene.los.half_width_m], atol=1e-4)
    assert target.edges[0].tag_id != target.edges[1].tag_id


def test_an_edge_that_is_not_upright_is_told_so_where_it_is() -> None:
    """Its middle is where it is looked for, which alone would contradict that it is not there."""
    tilted = {"units.b.frames.port_rear_marker_left.roll_deg": 10}
    with pytest.raises(
        SceneError, match=r"half_width_m 0\.0720 to the left; it is not upright, its ends are 5\.2 mm off"
    ):
        TargetModel.from_scene(scene := load_scene("round_robots", tilted), scene.docks[0])


def test_a_marker_beside_the_port_is_told_that_it_needs_an_edge_on_either_side() -> None:
    """Who entered what the message said got one that said the same again."""
    drawn = load_scene("round_robots").units["b"]
    frames = {
        n: f.model_dump() for n, f in drawn.frames.items() if n.partition("_marker_")[2] in ("", "left")
    }
    sizes = {name: size for name, size in drawn.tag_sizes_m.items() if name in frames}
    says = (
        r"half_width_m 0\.072 to the right; .* half_width_m 0\.0120 to the left\. The marker needs one "
        "upright edge half_width_m to the left of the middle of the port, and one as far to the right"
    )
    with pytest.raises(SceneError, match=says):
        TargetModel.from_scene(
            scene := load_scene("round_robots", {"units.b.frames": frames, "units.b.tag_sizes_m": sizes}),
            scene.docks[0],
        )


def test_a_los_target_off_the_tags_is_refused(scene: Scene) -> None:
    wide = scene.model_copy(update={"los": LosSpec(half_width_m=0.06)})
    with pytest.raises(SceneError, match=r"los: no tag edge of b.rear .* the nearest is 15.9 mm away"):
        TargetModel.from_scene(wide, wide.plan[0])


def test_a_port_without_tags_is_refused(scene: Scene) -> None:
    with pytest.raises(SceneError, match="carries no tags"):
        TargetModel.from_scene(scene, DockStep(unit="a", to="b.front"))


def test_calibration_comes_from_the_own_urdf(scene: Scene, target: TargetModel) -> None:
    geometry = scene.geometry("a")
    assert (target.camera_name, target.camera) == ("a/onboard", scene.cameras.onboard.pinhole)
    assert (target.wheel_radius, target.track) == (geometry.wheel_radius, geometry.track)
    assert target.front == geometry.port("front").x
    np.testing.assert_allclose(target.X_UC.act([0.0, 0.0, 1.0]) - target.X_UC.p, [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose((target.X_UC @ target.X_CU).matrix(), np.eye(4), atol=1e-12)


def test_a_camera_off_the_middle_of_its_image_at_another_rate_is_told_so(scene: Scene) -> None:
    """What the kernels get: the image of the ideal camera, also counted from the corner of what is shown."""
    told = {"fx_px": 400.0, "fy_px": 400.0, "cx_px": 330.0, "cy_px": 220.0, "k1": -0.1}
    cameras = {"onboard": {"rate_hz": 12.5, "latency_ms": 70.0, "calibration": told}}
    other = Scene.model_validate({**scene.model_dump(exclude={"cameras"}), "cameras": cameras})
    target = TargetModel.from_scene(other, other.plan[0])
    assert target.frame_period_s == 0.08
    assert target.latency_s == pytest.approx(0.07)
    x, y, corner = 330.0, 220.0, target.lens.bounds
    assert corner.x != corner.y
    assert 0 not in (corner.x, corner.y)
    np.testing.assert_allclose((target.optics.cx, target.optics.cy), (x, y))
    in_bounds = target.optics_in_bounds
    np.testing.assert_allclose((in_bounds.cx, in_bounds.cy), (x - corner.x, y - corner.y))
    ahead = target.camera.project(np.array([[0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(ahead, [[target.optics.cx, target.optics.cy]])
