"""The check that cameras see the tags that they need, by what a renderer draws of the robots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from msrr_bullet.built_poses import placed_tags
from msrr_bullet.checks.camera_views import (
    approach_begins,
    before_port,
    camera_distance,
    docks_by_sight,
    whole_tags,
)
from msrr_bullet.render.occlusion import hidden_points
from msrr_bullet.render.raster.bodies import LoadedBodies
from msrr_bullet.simulation.world import BulletWorld
from msrr_control.docking.law import DockSetup
from msrr_perception.pose.global_pose import overhead_pose
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import OverheadCameraSpec

#: Largest share of the modules of a tag on top that may be hidden. Of 2025 tags with more of it behind a
#: rectangle of any grey 39 were read. Less may be due to the errors of the grade with which the robots here
#: are built: of 320 ``rough`` ones one has a marker of a port that stands out of the roof.
_COVERED = 0.1


def check_views(scene: Scene, world: BulletWorld | None, bodies: LoadedBodies | None) -> None:
    """Refuse a scene in which a unit sees no tag of its port where it needs one, or covers its own on top.

    It needs one where its approach begins, where it ends, if the seat is verified by sight, and where the
    next attempt begins. Such a scene has no tag of the port as a whole in the picture, or has every tag of
    the target that is in the picture behind another part of the two robots. ``world`` is that of a trial;
    None if it needs none. ``bodies`` are what is drawn of it; None where nothing hides a tag, as for
    parametric cameras.

    Raises:
        SceneError: The message names the unit, and the port and the place, or the tag on top.
        GeometryError: A URDF lacks a frame.
    """
    drawn = None if world is None or bodies is None else _DrawnUnits(scene, world, bodies)
    if drawn is not None and scene.cameras.overhead is not None:
        _check_tops(scene, scene.cameras.overhead, drawn)
    for step in docks_by_sight(scene):
        target, setup = TargetModel.from_scene(scene, step), DockSetup.of(scene, step)
        places = [("where it begins another attempt", before_port(setup, scene.docking.retreat_m))]
        if (start := approach_begins(scene, step, setup)) is not None:
            places.insert(0, ("where its approach begins", start))
        if scene.docking.verify.by_sight:
            places.append(("in its seat", before_port(setup, 0.0)))
        for where, X_DU in places:
            place = f"{where}, {camera_distance(X_DU, setup):.2f} m away"
            X_CD = target.X_UC.inverse() @ SE3.from_se2(X_DU).inverse()
            if not whole_tags(target, X_CD, target.port_tags):
                raise SceneError(
                    f"the camera of {step.unit} has no tag of {step.to} as a whole in its picture {place}; "
                    "turn or move it or the tags, or widen its view"
                )
            if drawn is None:
                continue
            X_DT = SE3.from_se2(scene.dock_frame(step)).inverse()
            own, other = drawn.of(step.unit), drawn.of(step.target_unit)
            shapes = {
                step.unit: target.X_UC.inverse().act(own.triangles),
                step.target_unit: (X_CD @ X_DT).act(other.triangles),
            }
            hidden: list[str] = []
            names = {number: slot for slot, number in scene.tag_ids(step.target_unit).items()}
            for tag in whole_tags(target, X_CD, target.tags):
                modules = _modules((X_CD @ X_DT).act(other.tags[tag]), scene.tags.tag_family.edge_modules)
                by = [unit for unit, shape in shapes.items() if hidden_points(modules, shape).any()]
                if not by:
                    break
                hidden.append(f"{names[tag]} behind {' and '.join(by)}")
            else:
                raise SceneError(
                    f"the camera of {step.unit} sees no tag of {step.target_unit} as a whole {place}: parts "
                    f"of those in its picture are hidden ({', '.join(hidden)}); move the camera, the tags or "
                    "what hides them"
                )


def _check_tops(scene: Scene, camera: OverheadCameraSpec, drawn: _DrawnUnits) -> None:
    """Refuse units that cover their own tag on top, where they stand straight below the overhead camera.

    Raises:
        SceneError: The message names the unit and its tag.
    """
    R_UC = overhead_pose(camera).R
    alike = {(scene.geometry(u), scene.tag_size(u, "tag_top")): u for u in reversed(scene.units)}
    for (geometry, _), unit in alike.items():
        if "tag_top" not in geometry.tag_slots:
            continue
        seen = drawn.of(unit)
        corners_U = seen.tags[scene.tag_ids(unit)["tag_top"]]
        middle_U = corners_U.mean(axis=0)
        X_CU = SE3(R_UC, np.array([*middle_U[:2], camera.height_m])).inverse()
        modules = _modules(X_CU.act(corners_U), scene.tags.tag_family.edge_modules)
        if hidden_points(modules, X_CU.act(seen.triangles)).mean() > _COVERED:
            raise SceneError(
                f"units.{unit}.urdf: {geometry.urdf.name}: the robot covers its own tag tag_top, seen by the "
                "overhead camera straight above it; move the tag up, or move what lies over it"
            )


@dataclass(frozen=True, eq=False)
class _DrawnUnit:
    """What a renderer draws of a unit.

    Corners of triangles, shape (T, 3, 3), and of tags by their ids, shape (4, 3), are in U as built [m].
    """

    triangles: Array
    tags: Mapping[int, Array]


class _DrawnUnits:
    """What a renderer draws of the units of a scene."""

    def __init__(self, scene: Scene, world: BulletWorld, bodies: LoadedBodies) -> None:
        self._scene = scene
        self._world = world
        self._bodies = bodies
        self._known: dict[str, _DrawnUnit] = {}

    def of(self, unit: str) -> _DrawnUnit:
        if unit not in self._known:
            triangles = (
                self._world.pose3(unit).inverse().act(self._bodies.triangles(self._world.unit(unit).body))
            )
            tags = placed_tags(self._scene, self._world.built, unit).values()
            self._known[unit] = _DrawnUnit(triangles, {tag.tag_id: tag.corners_B for tag in tags})
        return self._known[unit]


def _modules(corners_C: Array, count: int) -> Array:
    """Return the middles of the modules of a tag, ``count`` along each edge, shape (count * count, 3) [m]."""
    across = (np.arange(count) + 0.5) / count
    first, right, down = corners_C[0], corners_C[1], corners_C[3]
    middles: Array = first + across[:, None, None] * (right - first) + across[:, None] * (down - first)
    return middles.reshape(-1, 3)
