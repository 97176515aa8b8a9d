"""True poses of cameras and tags, which follow from a scene and from how it was built."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from msrr_perception.pose.global_pose import overhead_pose
from msrr_scenes.arrays import Array
from msrr_scenes.as_built import AsBuilt, BuiltTag
from msrr_scenes.geometry.pinhole import body_pose, optical_pose
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.specs.scene import Scene

#: Height of the plate of an obstacle above the lid [m], so that the lid does not hide it: TinyRenderer draws
#: a cylinder 1 mm too tall.
PLATE_LIFT_M = 0.002

#: A tag that lies face up: z of T points down into the obstacle, the top edge points to +y of the obstacle.
R_BT = rotation_from_rpy(math.pi, 0.0, 0.0)


def camera_pose(scene: Scene, built: AsBuilt, unit: str) -> SE3:
    """Return the true pose ``X_UB`` of the camera body of a unit; x of B is the optical axis.

    It differs from the pose in the URDF, which the robot knows, by what was built and by the fault
    ``camera_misaligned``.
    """
    return built.units[unit].camera.mounted(scene.geometry(unit).frame("camera"))


def overhead_camera_pose(scene: Scene, built: AsBuilt) -> SE3:
    """Return the true pose ``X_WC`` of the optical frame of the overhead camera of a scene that has one."""
    assert scene.cameras.overhead is not None, "the scene has an overhead camera"
    assert built.overhead is not None, "an overhead camera was built"
    return optical_pose(built.overhead.mounted(body_pose(overhead_pose(scene.cameras.overhead))))


def obstacle_tag_pose(height_m: float, built: BuiltTag) -> SE3:
    """Return the true ``X_BT`` of the tag on the lid of an obstacle; B lies in the middle of the base."""
    X_BT = SE3(R_BT, np.array([0.0, 0.0, height_m + PLATE_LIFT_M]))
    return X_BT if built.X_TX is None else X_BT @ built.X_TX


@dataclass(frozen=True, slots=True, eq=False)
class PlacedTag:
    """A tag of a unit or of an obstacle as it was printed and put on.

    Attributes:
        tag_id: Its id.
        X_BT: True pose in the frame of its body.
        size: True edge of the black square [m].
    """

    tag_id: int
    X_BT: SE3
    size: float

    @property
    def corners_B(self) -> Array:
        """True corners in the frame of its body, shape (4, 3) [m]; see :func:`tag_corners` for the order."""
        return self.X_BT.act(tag_corners(self.size))


def placed_tags(scene: Scene, built: AsBuilt, name: str) -> dict[str, PlacedTag]:
    """Return the tags of a body as they were built, by the link that carries each; covered ones as well.

    The tag of an obstacle is called ``tag_top``, as that on a unit is.

    Raises:
        GeometryError: A link that carries a tag is not in the URDF.
    """
    if name in scene.units:
        unit = built.units[name]
        return {
            slot: PlacedTag(tag_id, unit.geometry.frame(slot), unit.print_scale * scene.tag_size(name, slot))
            for slot, tag_id in scene.tag_ids(name).items()
        }
    spec, tag = scene.obstacles[name], built.obstacle_tags.get(name)
    if tag is None or spec.tag_id is None:
        return {}
    X_BT = obstacle_tag_pose(spec.height_m, tag)
    return {"tag_top": PlacedTag(spec.tag_id, X_BT, tag.print_scale * spec.tag_m)}
