"""The known geometry of a docking pair: the unit's own camera and drive, and the target's tags."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from msrr_perception.kernels.project import Optics
from msrr_perception.pose.calibration import StateLayout, filter_layout, pose_layout, roof_layout
from msrr_perception.pose.corner_errors import UPRIGHT_CONTRAST, CornerErrors
from msrr_perception.pose.tolerances import Tolerances
from msrr_perception.pose.tone import straight_tone
from msrr_scenes.arrays import Array, frozen
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pin_and_hole import PinAndHole
from msrr_scenes.geometry.pinhole import PinholeCamera, optical_pose
from msrr_scenes.geometry.rolling_shutter import RollingShutter
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.messages import Pixels, onboard_camera
from msrr_scenes.specs.control import LosSpec
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.tag_families import TagFamily

#: Largest distance of the LOS points of the scene from the tag edges of the URDF [m]; scenes round to 0.1 mm.
_EDGE_TOLERANCE_M = 0.002

#: Corners of the left and of the right edge of a tag.
_UPRIGHT_EDGES = (0, 3), (1, 2)

#: Corners of the lower and of the upper edge of a tag that is not turned.
_LEVEL_EDGES = (0, 1), (3, 2)

#: Index of the yaw in a state or pose vector.
YAW = 2


def pose_vector(X_DU: SE2, pitch: float = 0.0, roll: float = 0.0) -> Array:
    """Return ``(x, y, yaw, pitch, roll)``, shape (5,) [m, rad]."""
    return np.array([X_DU.x, X_DU.y, X_DU.yaw, pitch, roll])


@dataclass(frozen=True, slots=True)
class TagEdge:
    """An upright black edge of a tag.

    Attributes:
        tag_id: Id of the tag.
        corners: Indices of the edge's two corners in the order of ``tag_corners``.
    """

    tag_id: int
    corners: tuple[int, int]


@dataclass(frozen=True, eq=False)
class TargetModel:
    """The docking unit's calibration and the map of the target's tags.

    The floor is flat and every height is known, so that the relative pose is ``X_DU``: x, y and yaw of the
    docking unit U in the dock frame D of the target port.

    Attributes:
        camera_name: Name of the docking unit's camera, ``<unit>/onboard``.
        lens: Intrinsics of that camera, by calibration.
        X_UC: Optical frame of that camera in U, by calibration.
        corners_D: Tag id -> corners in D, shape (4, 3) [m], of every tag of the target unit.
        port_tags: Ids of the tags of the target port.
        edges: Left and right edge of the LOS target (left: +y in D); none without a target.
        wheel_radius: Wheel radius of the docking unit, by calibration [m].
        track: Distance between the wheels of the docking unit, by calibration [m].
        front: Distance of the docking port's face ahead of U [m].
        mechanism: What the pins of the unit and the holes of the port tolerate; None for a unit without pins,
            or without a target.
        corner_errors: Errors of the corners of tags, by data sheet of the camera.
        tolerances: Tolerances of all of this calibration.
        frame_period_s: Time between two exposures of the camera [s].
        exposure_s: Time for which a pixel of the camera is exposed [s].
        shutter: When the camera exposes the rows of a frame, by data sheet.
        latency_s: Time from an exposure of the camera to the arrival of its tags [s].
        to_light: Grey level of every pixel value on a straight tone curve, shape (256,); None if the camera
            has one.
        tag_family: Family of the tags.
        roof: Standard deviations of the place of the tag on the unit's own roof, x, y [m] and yaw [rad] in U,
            shape (3,); None where its tags are not looked at from above.
    """

    camera_name: str
    lens: Lens
    X_UC: SE3
    corners_D: Mapping[int, Array]
    port_tags: tuple[int, ...]
    edges: tuple[TagEdge, ...]
    wheel_radius: float
    track: float
    front: float
    mechanism: PinAndHole | None
    corner_errors: CornerErrors
    tolerances: Tolerances
    frame_period_s: float
    exposure_s: float
    shutter: RollingShutter
    latency_s: float
    to_light: Pixels | None
    tag_family: TagFamily
    roof: Array | None = None

    @classmethod
    def from_scene(cls, scene: Scene, step: DockStep) -> TargetModel:
        """Build from the scene's geometry for one step of the plan.

        Raises:
            GeometryError: A URDF lacks a frame.
            SceneError: The target port has no tags, or no tag edge lies where the scene's LOS target is; that
                of a fixture is given by the outermost edges of its tags.
        """
        target = scene.geometry(step.target_unit)
        X_DT = SE3.from_se2(target.dock_frame(step.target_port)).inverse()
        ids = scene.tag_ids(step.target_unit)
        corners = {
            ids[slot]: frozen(
                (X_DT @ target.frame(slot)).act(tag_corners(scene.tag_size(step.target_unit, slot)))
            )
            for slot in target.tag_slots
        }
        port_tags = tuple(ids[slot] for slot in target.marker_slots(step.target_port))
        if not port_tags:
            raise SceneError(f"{step.to}: this port carries no tags, so nothing can be docked to it by sight")
        on_port = {i: corners[i] for i in port_tags}
        edges = _los_edges(on_port, scene.los, step.to) if target.drives else _outermost_edges(on_port)
        own = scene.geometry(step.unit)
        mechanism = PinAndHole.of(own, step.port, target, step.target_port) if own.pins else None
        return cls._of_unit(
            scene, step.unit, step.port, MappingProxyType(corners), port_tags, edges, mechanism
        )

    @classmethod
    def without_target(cls, scene: Scene, unit: str, port: str) -> TargetModel:
        """Build the calibration of a unit that has no target: of its camera, its drive and an active port."""
        return cls._of_unit(scene, unit, port, MappingProxyType({}), (), ())

    def seen_from_above(self, roof: Array) -> TargetModel:
        """Return the calibration of the drive alone, for a camera above that measures poses; see ``roof``."""
        return replace(self, corners_D=MappingProxyType({}), port_tags=(), edges=(), roof=frozen(roof))

    @classmethod
    def _of_unit(
        cls,
        scene: Scene,
        unit: str,
        port: str,
        corners_D: Mapping[int, Array],
        port_tags: tuple[int, ...],
        edges: tuple[TagEdge, ...],
        mechanism: PinAndHole | None = None,
    ) -> TargetModel:
        own, spec = scene.geometry(unit), scene.cameras.onboard
        return cls(
            camera_name=onboard_camera(unit),
            lens=spec.lens,
            X_UC=optical_pose(own.frame("camera")),
            corners_D=corners_D,
            port_tags=port_tags,
            edges=edges,
            wheel_radius=own.wheel_radius,
            track=own.track,
            front=own.port(port).x,
            mechanism=mechanism,
            corner_errors=CornerErrors.from_spec(spec, UPRIGHT_CONTRAST),
            tolerances=Tolerances.from_spec(scene.as_built),
            frame_period_s=1.0 / spec.rate_hz,
            exposure_s=1e-3 * spec.exposure_ms,
            shutter=spec.rolling_shutter,
            latency_s=1e-3 * spec.latency_ms,
            to_light=straight_tone(spec),
            tag_family=scene.tags.tag_family,
        )

    @property
    def camera(self) -> PinholeCamera:
        """The ideal camera, in the image of which detections are given."""
        return self.lens.camera

    @cached_property
    def X_CU(self) -> SE3:
        """Frame U in the camera's optical frame."""
        return self.X_UC.inverse()

    @cached_property
    def optics(self) -> Optics:
        """Camera and mounting in the layout that the kernels are compiled for: rotation in column order."""
        R_CU = np.array(self.X_CU.R, order="F")
        return Optics(R_CU, np.array(self.X_UC.p), self.camera.focal, self.camera.cx, self.camera.cy)

    @cached_property
    def optics_in_bounds(self) -> Optics:
        """The same with pixels that count from the corner of what the frame shows of the ideal image."""
        optics, part = self.optics, self.lens.bounds
        return optics._replace(cx=optics.cx - part.x, cy=optics.cy - part.y)

    @cached_property
    def layout(self) -> StateLayout:
        """Layout of a pose with tilt, for fits in which everything is as designed."""
        return pose_layout(self.corners_D, self.port_tags)

    @cached_property
    def filter_layout(self) -> StateLayout:
        """Layout of a filter's state: pose, drive, and what may not be as designed."""
        if self.roof is not None:
            return roof_layout(self.layout, self.roof)
        return filter_layout(self.layout, self.port_tags, self.tolerances)

    @cached_property
    def edge_points_D(self) -> tuple[list[float], list[float]]:
        """Middles (x, y, z) of the LOS target's left and right edge in D [m], as lists for speed."""
        left, right = (self.corners_D[e.tag_id][list(e.corners)].mean(axis=0).tolist() for e in self.edges)
        return left, right

    @cached_property
    def lateral_and_depth_rows(self) -> tuple[list[float], list[float]]:
        """Rows x and z of X_CU, each (R, R, R, p)."""
        lateral, _, depth = np.column_stack([self.X_CU.R, self.X_CU.p]).tolist()
        return lateral, depth

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
                for pair in _UPRIGHT_EDGES
            ),
            key=lambda found: found[0],
        )
        if distance > _EDGE_TOLERANCE_M:
            ends = corners_D[edge.tag_id][list(edge.corners), :2]
            (x, y), slant = ends.mean(axis=0), 0.5 * float(np.linalg.norm(ends[0] - ends[1]))
            oblique = f"; it is not upright, its ends are {1e3 * slant:.1f} mm off that; let it stand upright"
            raise SceneError(
                f"los: no tag edge of {port} at setback_m {los.setback_m}, half_width_m {los.half_width_m} "
                f"to the {_side(side)}; the nearest is {1e3 * distance:.1f} mm away, "
                f"at setback_m {x:.4f}, half_width_m {abs(y):.4f} to the {_side(y)}"
                f"{oblique if slant > _EDGE_TOLERANCE_M else ''}. The marker needs one upright edge "
                "half_width_m to the left of the middle of the port, and one as far to the right"
            )
        found.append(edge)
    return found[0], found[1]


def _side(y: float) -> str:
    return "left" if y > 0.0 else "right"


def _outermost_edges(corners_D: Mapping[int, Array]) -> tuple[TagEdge, TagEdge]:
    """Return the upright edges farthest to the left and to the right: a fixture has its tags anywhere.

    A tag that is turned on its side stands on what is its left or its right edge elsewhere. Of one that
    stands on a corner, the edges that are nearer to upright count.
    """
    edges, y = [], []
    for tag, corners in corners_D.items():
        along = np.abs(corners[1] - corners[0])[1:], np.abs(corners[2] - corners[1])[1:]  # (y, z) each
        lies, stands = (float(np.arctan2(*way)) for way in along)  # angles from upright
        for pair in _UPRIGHT_EDGES if stands <= lies else _LEVEL_EDGES:
            edges.append(TagEdge(tag, pair))
            y.append(float(corners[list(pair), 1].mean()))
    return edges[y.index(max(y))], edges[y.index(min(y))]
