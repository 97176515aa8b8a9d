"""Views of an arena from the overhead camera: units at any heading, one of them driving, and obstacles."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from msrr_bullet.bench.detection_metrics import DetectionRow, LabelledExposure, encloses, evaluate
from msrr_bullet.bench.detector_settings import overhead_candidates
from msrr_bullet.bench.onboard_views import with_sensor
from msrr_bullet.render import RenderContext, build_renderer
from msrr_bullet.sensors.camera import Camera
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_perception.pose.global_pose import GlobalLocalizer
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import NS_PER_S, OVERHEAD, Detections, GlobalPose
from msrr_scenes.placement.placement import Placement, draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec

#: Name of the scene, and its docking unit and target.
_SCENE, _UNITS = "two_obstacles", ("a", "b")

#: Exposures of one arrangement; the search for new bodies reads one in ten.
EXPOSURES = 20

#: Largest turn [rad] of the driving unit from one exposure to the next, and its path [m].
_TURN, _STEP_M = 0.05, 0.015

#: Standard deviations of the predictions, as the estimator has them in this scene [m, rad].
_SIGMA = np.array([0.3e-3, 0.3e-3, math.radians(0.12)])


def measure_overhead(
    arrangements: int,
    seed: int,
    *,
    noise_grey: float | None = None,
    blur_px: float | None = None,
    exposures: int = EXPOSURES,
) -> tuple[DetectionRow, ...]:
    """Compare all settings on the overhead camera.

    It is done as for :func:`msrr_bullet.bench.onboard_views.measure_onboard`; of each arrangement of units
    and obstacles there are some exposures, while the docking unit drives.
    """
    scene, spec, _ = _load()
    spec = with_sensor(spec, noise_grey, blur_px)
    model = OverheadModel.from_scene(scene.with_camera(OVERHEAD, spec), _UNITS)
    views = _views(scene, model, spec, arrangements, exposures, seed)
    return evaluate(overhead_candidates(model, _UNITS), views, stream(seed, "bench/detection/order"))


def module_sizes() -> tuple[float, float]:
    """Return the edge of a module [px] of the smallest and of the largest tag in the image."""
    _, _, model = _load()
    edges = [tag.edge_px(model.camera, model.X_WC) for tag in model.tags.values()]
    modules = [edge / model.tag_family.edge_modules for edge in edges]
    return min(modules), max(modules)


def _load() -> tuple[Scene, CameraSpec, OverheadModel]:
    scene = load_scene(_SCENE, {"as_built": "perfect"})
    spec = scene.cameras.overhead
    if spec is None:
        raise SceneError(f"{_SCENE}: has no overhead camera")
    return scene, spec, OverheadModel.from_scene(scene, _UNITS)


def _views(
    scene: Scene, model: OverheadModel, spec: CameraSpec, arrangements: int, exposures: int, seed: int
) -> Iterator[LabelledExposure[Mapping[str, GlobalPose]]]:
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
    """Draw a start of the scene with random headings of the units."""
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
) -> Iterator[LabelledExposure[Mapping[str, GlobalPose]]]:
    """Yield exposures while the docking unit drives an arc."""
    poses = {**placement.units, **placement.obstacles}
    motion = SE2(_STEP_M, 0.0, _TURN * float(rng.uniform(-1.0, 1.0)))
    localizer = model.localizer()
    for number in range(exposures):
        world.place(_UNITS[0], poses[_UNITS[0]], (0.0, 0.0))
        exposure = camera.expose(number * NS_PER_S // 10)
        assert exposure is not None, "this camera loses no frames"
        top = {i: localizer.pixels(tag, poses[tag.name]) for i, tag in model.tags.items()}
        yield LabelledExposure(
            exposure=exposure,
            fetch=camera.fetch,
            prediction={name: _prediction(name, X, exposure.stamp_ns, rng) for name, X in poses.items()},
            corners={**_upright(scene, model, poses), **top},
            in_view=frozenset(i for i, pixels in top.items() if encloses(camera.pinhole.frame, pixels)),
            pose_errors=partial(_pose_errors, localizer, dict(poses)),
            first=number == 0,
        )
        poses[_UNITS[0]] = poses[_UNITS[0]] @ motion


def _upright(scene: Scene, model: OverheadModel, poses: Mapping[str, SE2]) -> dict[int, Array]:
    """Return the exact corners [px] of the units' upright tags; those on masts are sometimes read."""
    corners = {}
    for unit, geometry in ((unit, scene.geometry(unit)) for unit in scene.units):
        X_CU = model.X_WC.inverse() @ SE3.from_se2(poses[unit])
        for slot in geometry.tag_slots:
            p_C = (X_CU @ geometry.frame(slot)).act(tag_corners(scene.tag_size(unit, slot)))
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
