"""What perception knows before it looks: tags and sizes of everybody, places of nobody."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from msrr_bullet.built_poses import obstacle_tag_pose
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.as_built import BuiltTag
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.distortion import Distortion, has_inverse
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.specs.scene import Scene


def arena(**changes: Any) -> Scene:
    return Scene.model_validate(
        {
            "name": "arena",
            "units": {"a": {"number": 0, "pose": {"x_m": -1.0}}, "b": {"number": 1}, "c": {"number": 7}},
            "obstacles": {
                "post": {"shape": "cylinder", "radius_m": 0.06, "height_m": 0.2, "tag_id": 500},
                "late": {
                    "shape": "box",
                    "length_m": 0.2,
                    "width_m": 0.1,
                    "tag_id": 501,
                    "appears_at_s": 5.0,
                    "pose": {"x_m": 1.0},
                },
                "bare": {"shape": "cylinder", "radius_m": 0.05},
            },
            "cameras": {"overhead": {}},
            "plan": [{"unit": "a", "to": "b.rear"}],
            **changes,
        }
    )


def test_the_catalogue_holds_every_tag_and_what_is_still_to_come() -> None:
    scene = arena()
    model = OverheadModel.from_scene(scene, ("a", "b"))
    assert {tag: flat.name for tag, flat in model.tags.items()} == {
        0: "a",
        10: "b",
        70: "c",
        500: "post",
        501: "late",
    }
    assert model.obstacle_radius == {"post": 0.06, "late": pytest.approx(0.5 * np.hypot(0.2, 0.1))}
    assert model.units == ("a", "b", "c")


def test_it_is_the_same_wherever_the_bodies_stand() -> None:
    """Nothing that a pose in the scene decides may reach the model."""

    def knowledge(scene: Scene) -> str:
        model = OverheadModel.from_scene(scene, ("a", "b"))
        corners = {tag: (flat.name, flat.corners_B.tolist()) for tag, flat in model.tags.items()}
        return repr((model.camera, model.X_WC.matrix(), corners, model.obstacle_radius, model.noise))

    scene = arena()
    moved = scene.model_dump()
    for group in ("units", "obstacles"):
        for i, body in enumerate(moved[group].values()):
            body["pose"].update(x_m=0.1 * i, y_m=-0.3, yaw_deg=33.0, frame="world")
    assert knowledge(Scene.model_validate(moved)) == knowledge(scene)


def test_obstacle_tags_lie_where_the_simulated_plates_lie() -> None:
    scene = arena()
    model = OverheadModel.from_scene(scene, ("a", "b"))
    for name in ("post", "late"):
        spec = scene.obstacles[name]
        assert spec.tag_id is not None
        expected = obstacle_tag_pose(spec.height_m, BuiltTag()).act(tag_corners(spec.tag_m))
        np.testing.assert_allclose(model.tags[spec.tag_id].corners_B, expected, atol=1e-12)


def test_what_cannot_be_located_from_above_is_refused() -> None:
    blind = arena(cameras={})
    with pytest.raises(SceneError, match="no overhead camera"):
        OverheadModel.from_scene(blind, ("a", "b"))


@pytest.mark.parametrize("k1", [0.0, -0.1, 0.1])
def test_the_window_of_a_square_is_the_smallest_that_holds_what_is_seen_of_it(k1: float) -> None:
    """At the height of the tag of a unit, by a camera that stands beside the origin of the world."""
    scene = arena(cameras={"overhead": {"x_m": 0.3, "y_m": -0.2}})
    drawn = OverheadModel.from_scene(scene, ("a", "b"))
    model = replace(drawn, lens=Lens(drawn.camera, Distortion(k1=k1)))
    assert has_inverse(model.camera, model.lens.distortion)
    rng = np.random.default_rng(1)
    for _ in range(20):
        middle, half_m = rng.uniform([-0.4, -0.6], [1.0, 0.2]), rng.uniform(0.05, 0.2)
        corners = middle + half_m * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        points = np.column_stack([corners, np.full(4, model.tags[0].height)])
        shown = model.lens.distorted(model.camera.project(model.X_WC.inverse().act(points)))
        assert model.camera.contains(shown).all()
        assert model.square(middle, half_m, "a") == Window.around(shown, 0.0)
    for at in ([5.0, -0.2], [12.0, 0.5]):  # where the polynomial of a lens may lead back into the frame
        assert model.square(np.array(at), 0.1, "a").x >= model.camera.width - 1
