"""How large the cameras of a scene show the tags that they have to read."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from msrr_control.docking.law import DockSetup
from msrr_control.staging.registry import route_params
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.placement.placement import close_range_steps, nominal_units
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Pixels per module from which on a tag is read. Of rendered tags at any angle, with a blur of 0.3 px, all of
#: 480 with 1.5 px were read, and 165 of 240 with 1.25 px; with a blur of 1.3 px 74 of 80, and none.
_READ_PX = 1.5

_MEND = "raise width_px and height_px, or take larger tags"


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
        edges = {tag.name: model.edge_px(tag_id) for tag_id, tag in model.tags.items()}
        small = ", ".join(name for name, edge in edges.items() if edge < _READ_PX * modules)
        if small:
            shown = _shown(min(edges.values()), modules)
            yield f"cameras.overhead: tags on top ({small}) are {shown}; lower height_m, {_MEND}"
    for step in scene.docks:
        edge, distance = _onboard_edge(scene, step)
        if edge < _READ_PX * modules:
            place = f"{distance:.2f} m from {step.to}, where {step.unit} begins its approach"
            yield f"cameras.onboard: {place}, tags are {_shown(edge, modules)}; {_MEND}"


def _shown(edge: float, modules: int) -> str:
    return f"{edge:.1f} px wide, {edge / modules:.2f} px per module, and read reliably from {_READ_PX:g} on"


def _onboard_edge(scene: Scene, step: DockStep) -> tuple[float, float]:
    """Return the edge [px] of the port's largest tag where the approach begins, and its distance [m]."""
    target, setup = TargetModel.from_scene(scene, step), DockSetup.of(scene, step)
    params = route_params(scene.control.assembly)
    if params is None or close_range_steps(scene).get(step.unit) is step:
        placed = nominal_units(scene)
        X_TD = scene.geometry(step.target_unit).dock_frame(step.target_port)
        X_DU = (placed[step.target_unit] @ X_TD).inverse() @ placed[step.unit]
        distance = math.hypot(X_DU.x, X_DU.y) - setup.camera_offset
    else:
        distance = params.route.handover_m + setup.offset - setup.camera_offset
    largest = max(_edge(target.corners_D[i]) for i in target.port_tags)
    return target.camera.focal * largest / distance, distance


def _edge(corners: Array) -> float:
    return float(np.linalg.norm(corners[1] - corners[0]))
