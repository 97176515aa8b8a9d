"""Views of a port from the docking unit's camera, spread over distance and inside the cone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from msrr_bullet.bench.detection_metrics import (
    DetectionRow,
    LabelledExposure,
    encloses,
    evaluate,
    shortest_edge,
)
from msrr_bullet.bench.detector_settings import onboard_candidates
from msrr_bullet.bench.renderer_scenes import facing_units
from msrr_bullet.render import RenderContext, build_renderer
from msrr_bullet.sensors.camera import Camera
from msrr_bullet.simulation.world import BulletWorld
from msrr_perception.pose.joint_pose import DEFAULT_CORNER_NOISE, joint_pose
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import NS_PER_S, Detections, PoseEstimate
from msrr_scenes.placement.placement import target_in_cone
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec

#: Bounds of the strata: distance between the two faces [m].
DISTANCES_M = (0.12, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.2)

#: Largest lateral offset of a view as a share of the distance, and largest yaw [rad]; the cone limits both.
_LATERAL_SHARE, _YAW = 0.4, math.radians(35.0)

#: Standard deviations of the prediction for the next exposure, as the filter has them in ``close_range``:
#: position as a share of the distance, its least value [m], and heading [rad].
_SIGMA_SHARE, _LEAST_SIGMA_M, _SIGMA_YAW = 1.2e-3, 0.2e-3, math.radians(0.1)

#: Least edge of a tag's black square that can be read: a pixel for each of its 8 modules [px].
_LEAST_EDGE_PX = 8.0


def measure_onboard(
    views: int,
    seed: int,
    *,
    noise_grey: float | None = None,
    blur_px: float | None = None,
    distances_m: tuple[float, ...] = DISTANCES_M,
) -> tuple[DetectionRow, ...]:
    """Compare all settings on the docking unit's camera of scene ``close_range``.

    Args:
        views: Views for each stratum of distance.
        seed: Seed of the views, the noise, and the errors of the predictions.
        noise_grey: Read noise instead of the scene's [grey levels].
        blur_px: Lens blur instead of the scene's [px].
        distances_m: Bounds of the strata, distances between the two faces, ascending.
    """
    with facing_units(SE2(-0.8, 0.0, 0.0)) as (scene, world):
        spec = with_sensor(scene.cameras.onboard, noise_grey, blur_px)
        scene = scene.with_camera("onboard", spec)  # the robot is told the data sheet
        target = TargetModel.from_scene(scene, scene.docks[0])
        rng = stream(seed, "bench/detection/onboard")
        poses = _poses(scene, views, distances_m, rng)
        exposures = _exposures(scene, world, target, spec, poses, seed, rng)
        return evaluate(onboard_candidates(target), exposures, stream(seed, "bench/detection/order"))


def with_sensor(spec: CameraSpec, noise_grey: float | None, blur_px: float | None) -> CameraSpec:
    """Return a camera that reads out full frames, with other noise or blur if they are given."""
    changes = {"readout": "frames", "noise_grey": noise_grey, "blur_px": blur_px}
    return spec.model_copy(update={key: value for key, value in changes.items() if value is not None})


def _exposures(
    scene: Scene,
    world: BulletWorld,
    target: TargetModel,
    spec: CameraSpec,
    poses: Iterable[SE2],
    seed: int,
    rng: np.random.Generator,
) -> Iterator[LabelledExposure[PoseEstimate]]:
    step = scene.docks[0]
    X_WD = world.pose(step.target_unit) @ scene.dock_frame(step)
    renderer = build_renderer(spec.renderer, RenderContext(world.client, spec.samples))
    X_WC = SE3()
    camera = Camera(target.camera_name, spec, renderer, lambda: X_WC, seed)
    for number, X_DU in enumerate(poses):
        world.place(step.unit, X_WD @ X_DU, (0.0, 0.0))
        # Edges exactly upright in the image share an aliasing error; real floors and wheels are less exact.
        roll, pitch = rng.normal(0.0, DEFAULT_CORNER_NOISE.tilt_sigma, 2)
        X_UtiltC = SE3.from_xyz_rpy([0.0, 0.0, 0.0], [roll, pitch, 0.0]) @ target.X_UC
        X_WC = SE3.from_se2(X_WD @ X_DU) @ X_UtiltC
        exposure = camera.expose(number * NS_PER_S // 25)
        assert exposure is not None, "this camera loses no frames"
        corners = _facing(target, SE3.from_se2(X_DU) @ X_UtiltC)
        yield LabelledExposure(
            exposure=exposure,
            fetch=camera.fetch,
            prediction=_prediction(X_DU, exposure.stamp_ns, -X_DU.x - target.front, rng),
            corners=corners,
            in_view=frozenset(
                tag
                for tag, pixels in corners.items()
                if encloses(target.camera.frame, pixels) and shortest_edge(pixels) >= _LEAST_EDGE_PX
            ),
            pose_errors=partial(_pose_errors, target, X_DU),
            first=True,
        )


def _poses(scene: Scene, views: int, distances_m: Sequence[float], rng: np.random.Generator) -> Iterator[SE2]:
    """Draw poses X_DU with the target inside the outer cone, from the nearest stratum to the farthest."""
    step = scene.docks[0]
    geometry = scene.geometry(step.unit)
    for near, far in pairwise(distances_m):
        missing = views
        while missing:
            d, lateral, yaw = (float(a) for a in rng.uniform([near, -1.0, -1.0], [far, 1.0, 1.0]))
            X_DU = SE2(-geometry.port(step.port).x - d, _LATERAL_SHARE * d * lateral, _YAW * yaw)
            if target_in_cone(X_DU, geometry, scene.los):
                missing -= 1
                yield X_DU


def _prediction(X_DU: SE2, stamp_ns: int, distance_m: float, rng: np.random.Generator) -> PoseEstimate:
    sigma_m = max(_LEAST_SIGMA_M, _SIGMA_SHARE * distance_m)
    sigma = np.array([sigma_m, sigma_m, _SIGMA_YAW])
    dx, dy, dyaw = (float(e) for e in sigma * rng.standard_normal(3))
    return PoseEstimate(stamp_ns, SE2(X_DU.x + dx, X_DU.y + dy, X_DU.yaw + dyaw), np.diag(sigma**2), stamp_ns)


def _facing(target: TargetModel, X_DC: SE3) -> dict[int, Array]:
    """Return the exact corners [px] of the tags whose printed side is turned to the camera."""
    corners = {}
    for tag, p_D in target.corners_D.items():
        p_C = X_DC.inverse().act(p_D)
        into_tag = np.cross(p_C[1] - p_C[0], p_C[0] - p_C[3])
        if p_C[:, 2].min() > 0.0 and float(into_tag @ p_C.mean(axis=0)) > 0.0:
            corners[tag] = target.camera.project(p_C)
    return corners


def _pose_errors(target: TargetModel, X_DU: SE2, found: Detections) -> list[tuple[float, float]]:
    pose = joint_pose(target, found.tags)
    if pose is None:
        return []
    error = X_DU.inverse() @ pose.X_DU
    return [(math.hypot(error.x, error.y), abs(error.yaw))]
