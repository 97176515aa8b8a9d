"""What perception knows before it looks: tags and sizes of everybody, places of nobody."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from msrr_bullet.built_poses import obstacle_tag_pose
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.as_built import BuiltTag
from msrr_scenes.errors import SceneError
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
