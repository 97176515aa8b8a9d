"""Views of an arena from the overhead camera: units at any heading, one of them driving, and obstacles."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from msrr_bullet.bench.detection_metrics import DetectionRow, View, compare
from msrr_bullet.bench.detector_settings import overhead_contestants
from msrr_bullet.bench.onboard_detection import inside, with_sensor
from msrr_bullet.render.renderer import RenderContext, build_renderer
from msrr_bullet.sensors.camera import Camera
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_perception.pose.global_pose import GlobalLocalizer
from msrr_perception.pose.overhead_model import OVERHEAD, OverheadModel
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import NS_PER_S, Detections, GlobalPose
from msrr_scenes.placement.placement import Placement, draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec

#: The scene that is looked at.
SCENE = "two_obstacles"

#: Exposures of one arrangement; the search has a period of ten of them.
EXPOSURES = 20

#: The driving unit's greatest turn from one exposure to the next, and its way [rad, m].
_TURN, _WAY_M = 0.05, 0.015

#: Standard deviations of the predictions, as the estimator has them in this scene [m, rad].
_SIGMA = np.array([0.3e-3, 0.3e-3, math.radians(0.12)])


def overhead_rows(
    arrangements: int,
    seed: int,
    *,
    noise_grey: float | None = None,
    blur_px: float | None = None,
    exposures: int = EXPOSURES,
) -> tuple[DetectionRow, ...]:
    """Compare all settings on the overhead camera.

    Args:
        arrangements: Of units and obstacles.
        seed: Of the arrangements, the noise, and the predictions' errors.
        noise_grey: In the place of the scene's read noise [grey levels].
        blur_px: In the place of the scene's lens blur [px].
        exposures: Of each arrangement, while the docking unit drives.
    """
    scene, spec, model = _arena()
    views = _views(scene, model, with_sensor(spec, noise_grey, blur_px), arrangements, exposures, seed)
    return compare(overhead_contestants(model), views, stream(seed, "bench/detection/order"))


def module_px() -> tuple[float, float]:
    """Return the edge of a module of the smallest and of the largest tag below the camera [px]."""
    _, _, model = _arena()
    above = float(model.X_WC.p[2])
    edges = [
        model.camera.focal * float(np.linalg.norm(tag.corners_B[1] - tag.corners_B[0])) / (above - tag.height)
        for tag in model.tags.values()
    ]
    return min(edges) / 8.0, max(edges) / 8.0


def _arena() -> tuple[Scene, CameraSpec, OverheadModel]:
    scene = load_scene(SCENE)
    spec = scene.cameras.overhead
    if spec is None:
        raise SceneError(f"{SCENE}: has no overhead camera")
    return scene, spec, OverheadModel.from_scene(scene, scene.plan[0])


def _views(
    scene: Scene, model: OverheadModel, spec: CameraSpec, arrangements: int, exposures: int, seed: int
) -> Iterator[View[Mapping[str, GlobalPose]]]:
    rng = stream(seed, "bench/detection/overhead")
    for number in range(arrangements):
        placement = _placement(scene, rng)
        with tempfile.TemporaryDirectory(prefix="msrr-") as folder:
            tags = TagVisuals(scene, Path(folder))
            with BulletWorld(scene, placement, tags=tags) as world:
                renderer = build_renderer(spec.renderer, RenderContext(world.client, spec.samples))
                camera = Camera(OVERHEAD, spec, renderer, lambda: model.X_WC, seed + number)
                yield from _drive(scene, world, camera, model, placement, exposures, rng)


def _placement(scene: Scene, rng: np.random.Generator) -> Placement:
    """Draw a start of the scene and turn its units to any heading."""
    drawn = draw_placement(scene, lambda _: rng)
    units = {u: SE2(X.x, X.y, float(rng.uniform(-math.pi, math.pi))) for u, X in drawn.units.items()}
    return Placement(units, drawn.obstacles)


def _drive(
    scene: Scene,
    world: BulletWorld,
    camera: Camera,
    model: OverheadModel,
    placement: Placement,
    exposures: int,
    rng: np.random.Generator,
) -> Iterator[View[Mapping[str, GlobalPose]]]:
    """Let the docking unit drive an arc while the camera exposes."""
    poses = {**placement.units, **placement.obstacles}
    move = SE2(_WAY_M, 0.0, _TURN * float(rng.uniform(-1.0, 1.0)))
    localizer = model.localizer(corner_sigma_px=0.2)
    for number in range(exposures):
        world.place(model.own, poses[model.own], (0.0, 0.0))
        exposure = camera.expose(number * NS_PER_S // 10)
        assert exposure is not None, "this camera loses no frames"
        flat = {i: localizer.pixels(tag, poses[tag.name]) for i, tag in model.tags.items()}
        yield View(
            exposure=exposure,
            fetch=camera.fetch,
            prediction={name: _prediction(name, X, exposure.stamp_ns, rng) for name, X in poses.items()},
            corners={**_upright(scene, model, poses), **flat},
            in_view=frozenset(i for i, pixels in flat.items() if inside(camera.pinhole, pixels)),
            pose_errors=partial(_pose_errors, localizer, dict(poses)),
            first=number == 0,
        )
        poses[model.own] = poses[model.own] @ move


def _upright(scene: Scene, model: OverheadModel, poses: Mapping[str, SE2]) -> dict[int, Array]:
    """Return the exact corners [px] of the units' other tags; the masts' are sometimes read at a slant."""
    corners = {}
    for unit, geometry in ((unit, scene.geometry(unit)) for unit in scene.units):
        X_CU = model.X_WC.inverse() @ SE3.from_se2(poses[unit])
        for slot in geometry.tag_slots:
            p_C = (X_CU @ geometry.frame(slot)).act(tag_corners(scene.tag_size(slot)))
            corners[scene.tag_ids(unit)[slot]] = model.camera.project(p_C)
    return corners


def _pose_errors(
    localizer: GlobalLocalizer, poses: Mapping[str, SE2], found: Detections
) -> list[tuple[float, float]]:
    errors = (poses[located.name].inverse() @ located.X_WB for located in localizer.locate(found))
    return [(math.hypot(e.x, e.y), abs(e.yaw)) for e in errors]


def _prediction(name: str, X_WB: SE2, stamp_ns: int, rng: np.random.Generator) -> GlobalPose:
    dx, dy, dyaw = (float(e) for e in _SIGMA * rng.standard_normal(3))
    return GlobalPose(name, stamp_ns, SE2(X_WB.x + dx, X_WB.y + dy, X_WB.yaw + dyaw), np.diag(_SIGMA**2))
