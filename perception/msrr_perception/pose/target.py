"""All that perception knows of the pair: its own camera and drive, and where the target's tags are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from msrr_perception.kernels.project import Optics
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.pinhole import PinholeCamera, optical_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.specs.plan import DockStep, LosSpec
from msrr_scenes.specs.scene import Scene

#: How far the LOS points of the scene may lie from the tag edges of the URDF [m]; scenes round to 0.1 mm.
_EDGE_TOLERANCE_M = 0.002


@dataclass(frozen=True, slots=True)
class TagEdge:
    """An upright black edge of a tag.

    Attributes:
        tag_id: The tag.
        corners: Indices of the edge's two corners in the order of ``tag_corners``.
    """

    tag_id: int
    corners: tuple[int, int]


@dataclass(frozen=True, eq=False)
class TargetModel:
    """The docking unit's calibration and its map of the target.

    The floor is flat and every height is known, so that the relative pose is ``X_DU``: x, y and yaw of the
    docking unit U in the dock frame D of the target port.

    Attributes:
        camera_name: The camera that looks, ``<unit>/onboard``.
        camera: Its intrinsics.
        X_UC: Its optical frame in U, by calibration.
        corners_D: Tag id -> corners in D, shape (4, 3) [m]; every tag of the target unit.
        port_tags: Ids of the tags of the target port itself.
        edges: The left and the right edge of the LOS target (left: +y in D).
        wheel_radius: Of the docking unit, by calibration [m].
        track: Of the docking unit, by calibration [m].
        front: How far the docking port's face is ahead of U [m].
    """

    camera_name: str
    camera: PinholeCamera
    X_UC: SE3
    corners_D: Mapping[int, Array]
    port_tags: tuple[int, ...]
    edges: tuple[TagEdge, TagEdge]
    wheel_radius: float
    track: float
    front: float

    @classmethod
    def from_scene(cls, scene: Scene, step: DockStep) -> TargetModel:
        """Build from the scene's geometry for one step of its plan.

        Raises:
            GeometryError: A URDF without the frames named.
            SceneError: The target port has no tags, or none ends where the scene's LOS target is.
        """
        own, target = scene.geometry(step.unit), scene.geometry(step.target_unit)
        X_DT = SE3.from_se2(target.dock_frame(step.target_port)).inverse()
        ids = scene.tag_ids(step.target_unit)
        corners = {
            ids[slot]: (X_DT @ target.frame(slot)).act(tag_corners(scene.tag_size(slot)))
            for slot in target.tag_slots
        }
        prefix = f"port_{step.target_port}_marker_"
        port_tags = tuple(ids[slot] for slot in target.tag_slots if slot.startswith(prefix))
        if not port_tags:
            raise SceneError(f"{step.to}: this port carries no tags, so nothing can be docked to it by sight")
        return cls(
            camera_name=f"{step.unit}/onboard",
            camera=scene.cameras.onboard.pinhole,
            X_UC=optical_pose(own.frame("camera")),
            corners_D=MappingProxyType(corners),
            port_tags=port_tags,
            edges=_los_edges({i: corners[i] for i in port_tags}, scene.los, step.to),
            wheel_radius=own.wheel_radius,
            track=own.track,
            front=own.port(step.port).x,
        )

    @cached_property
    def X_CU(self) -> SE3:
        """U in the camera's optical frame."""
        return self.X_UC.inverse()

    @cached_property
    def optics(self) -> Optics:
        """Camera and mounting as the kernels are compiled for them: the rotation lies by columns."""
        R_CU = np.array(self.X_CU.R, order="F")
        return Optics(R_CU, np.array(self.X_UC.p), self.camera.focal, self.camera.cx, self.camera.cy)

    @cached_property
    def edge_points_D(self) -> Array:
        """Middles of the LOS target's left and right edge in D, shape (2, 3) [m]."""
        return np.stack([self.corners_D[e.tag_id][list(e.corners)].mean(axis=0) for e in self.edges])

    @cached_property
    def edge_places_D(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """The same points as numbers: asked for at every control instant, where arrays of two are slow."""
        (lx, ly, lz), (rx, ry, rz) = self.edge_points_D.tolist()
        return (lx, ly, lz), (rx, ry, rz)

    @cached_property
    def sideways_and_ahead(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Rows x and z of X_CU, each (R, R, R, p), as numbers."""
        x, _, z = np.column_stack([self.X_CU.R, self.X_CU.p]).tolist()
        return tuple(x), tuple(z)

    @cached_property
    def all_corners_D(self) -> Array:
        """Corners of all tags in D, shape (tags, 4, 3) [m], in the order of :attr:`tags`."""
        return np.stack([self.corners_D[tag] for tag in self.tags])

    @cached_property
    def tags(self) -> tuple[int, ...]:
        """Ids of all tags of the target unit, ascending."""
        return tuple(sorted(self.corners_D))


def _los_edges(corners_D: Mapping[int, Array], los: LosSpec, port: str) -> tuple[TagEdge, TagEdge]:
    found = []
    for side in (+1.0, -1.0):
        point = np.array([los.setback_m, side * los.half_width_m])
        distance, edge = min(
            (
                (float(np.linalg.norm(corners[list(pair), :2] - point, axis=1).max()), TagEdge(tag, pair))
                for tag, corners in corners_D.items()
                for pair in ((0, 3), (1, 2))  # the left and the right edge of a tag
            ),
            key=lambda found: found[0],
        )
        if distance > _EDGE_TOLERANCE_M:
            raise SceneError(
                f"los: no tag edge of {port} at setback_m {los.setback_m}, half_width_m {los.half_width_m}; "
                f"the nearest is {1e3 * distance:.1f} mm away"
            )
        found.append(edge)
    return found[0], found[1]
