"""What the cameras of a scene see of the tags that they have to read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from msrr_control.docking.law import DockSetup
from msrr_control.staging.registry import route_params
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.placement.placement import close_range_steps, nominal_units
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Pixels per module from which on a tag is read. Of rendered tags at any angle, with a blur of 0.3 px, all of
#: 480 with 1.5 px were read, and 165 of 240 with 1.25 px; with a blur of 1.3 px 74 of 80, and none.
_READ_PX = 1.5


def coarse_tags(scene: Scene) -> Iterator[str]:
    """Yield in words which tags a camera shows too small to be read reliably, and what would help.

    They are no reason to refuse a scene: a better detector, or luck, may read them.

    Raises:
        SceneError: A port has no tags.
        GeometryError: A URDF lacks a frame.
    """
    if scene.perception != "images":
        return
    modules = scene.tags.tag_family.edge_modules
    if scene.cameras.overhead is not None:
        model = OverheadModel.from_scene(scene, ())
        edges = {tag.name: tag.edge_px(model.camera, model.X_WC) for tag in model.tags.values()}
        small = ", ".join(name for name, edge in edges.items() if edge < _READ_PX * modules)
        if small:
            shown = _shown(min(edges.values()), modules)
            yield f"cameras.overhead: tags on top ({small}) are {shown}; lower height_m, {_MEND}"
    for step in docks_by_sight(scene):
        target, setup = TargetModel.from_scene(scene, step), DockSetup.of(scene, step)
        X_DU = approach_begins(scene, step, setup)
        if X_DU is None:
            continue
        X_CD = target.X_UC.inverse() @ SE3.from_se2(X_DU).inverse()
        edge = max(whole_tags(target, X_CD, target.port_tags).values(), default=0.0)
        if edge < _READ_PX * modules:
            place = f"{camera_distance(X_DU, setup):.2f} m from {step.to}, where {step.unit} begins"
            yield f"cameras.onboard: {place} its approach, tags are {_shown(edge, modules)}; {_MEND}"


_MEND = "raise width_px and height_px, or take larger tags"


def _shown(edge: float, modules: int) -> str:
    return f"{edge:.1f} px wide, {edge / modules:.2f} px per module, and read reliably from {_READ_PX:g} on"


def before_port(setup: DockSetup, gap: float) -> SE2:
    """Return the pose X_DU straight before the port, the faces ``gap`` apart [m]."""
    return SE2(-setup.offset - gap, 0.0, 0.0)


def camera_distance(X_DU: SE2, setup: DockSetup) -> float:
    """Return the distance of the camera of a unit at X_DU from the middle of the port [m]."""
    return math.hypot(X_DU.x, X_DU.y) - setup.camera_offset


def docks_by_sight(scene: Scene) -> tuple[DockStep, ...]:
    """Return what docks by what it sees; of robots that build a shape one of each pair that differs."""
    return scene.docks if scene.shape is None else scene.possible_docks


def approach_begins(scene: Scene, step: DockStep, setup: DockSetup) -> SE2 | None:
    """Return the pose X_DU from which a unit approaches its port; None where a class of a user decides."""
    if close_range_steps(scene).get(step.unit) is not step:
        params = route_params(scene.control.assembly)
        return None if params is None else before_port(setup, params.route.handover_m)
    placed = nominal_units(scene)
    return (placed[step.target_unit] @ scene.dock_frame(step)).inverse() @ placed[step.unit]


def whole_tags(target: TargetModel, X_CD: SE3, tags: Iterable[int]) -> dict[int, float]:
    """Return the longest edge [px] of those of some tags that face the camera, whole in its picture."""
    found = {}
    for tag_id in tags:
        p_C = X_CD.act(target.corners_D[tag_id])
        normal = np.cross(p_C[1] - p_C[0], p_C[3] - p_C[0])
        if p_C[:, 2].min() <= 0.0 or normal @ p_C[0] >= 0.0:
            continue
        ideal = target.camera.project(p_C)
        if target.lens.shows(ideal).all():
            found[tag_id] = float(np.linalg.norm(ideal - np.roll(ideal, 1, axis=0), axis=1).max())
    return found
