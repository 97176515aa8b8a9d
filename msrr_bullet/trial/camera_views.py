"""What the cameras of a scene see of the tags that they have to read."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from msrr_control.docking.law import DockSetup
from msrr_control.staging.registry import route_params
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.placement.placement import close_range_steps, nominal_units
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Pixels per module from which on a tag is read. Of rendered tags at any angle, with a blur of 0.3 px, all of
#: 480 with 1.5 px were read, and 165 of 240 with 1.25 px; with a blur of 1.3 px 74 of 80, and none.
_READ_PX = 1.5


def check_views(scene: Scene) -> None:
    """Refuse a scene in which a unit has no tag of its port in the picture where it needs one.

    That is where its approach begins, where it ends, if the seat is verified by sight, and where the next
    attempt begins. Bodies that hide a tag are not considered.

    Raises:
        SceneError: The message names the unit, the port and the place.
        GeometryError: A URDF lacks a frame.
    """
    for step in scene.docks:
        target, setup = TargetModel.from_scene(scene, step), DockSetup.of(scene, step)
        begin = _begin(scene, step, setup)
        places = [
            ("where its approach begins", begin),
            ("where it begins another attempt", _at(setup, scene.docking.retreat_m)),
        ]
        if scene.docking.verify.by_sight:
            places.append(("in its seat", _at(setup, 0.0)))
        for where, X_DU in places:
            if not _edges(target, X_DU):
                raise SceneError(
                    f"the camera of {step.unit} has no tag of {step.to} as a whole in its picture {where}, "
                    f"{_distance(X_DU, setup):.2f} m away; turn or move it or the tags, or widen its view"
                )


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
        target, setup = TargetModel.from_scene(scene, step), DockSetup.of(scene, step)
        X_DU = _begin(scene, step, setup)
        edge = max(_edges(target, X_DU), default=0.0)
        if edge < _READ_PX * modules:
            place = f"{_distance(X_DU, setup):.2f} m from {step.to}, where {step.unit} begins its approach"
            yield f"cameras.onboard: {place}, tags are {_shown(edge, modules)}; {_MEND}"


_MEND = "raise width_px and height_px, or take larger tags"


def _shown(edge: float, modules: int) -> str:
    return f"{edge:.1f} px wide, {edge / modules:.2f} px per module, and read reliably from {_READ_PX:g} on"


def _at(setup: DockSetup, gap: float) -> SE2:
    return SE2(-setup.offset - gap, 0.0, 0.0)


def _distance(X_DU: SE2, setup: DockSetup) -> float:
    return math.hypot(X_DU.x, X_DU.y) - setup.camera_offset


def _begin(scene: Scene, step: DockStep, setup: DockSetup) -> SE2:
    """Return the pose X_DU from which a unit approaches its port."""
    params = route_params(scene.control.assembly)
    if params is not None and close_range_steps(scene).get(step.unit) is not step:
        return _at(setup, params.route.handover_m)
    placed = nominal_units(scene)
    X_TD = scene.geometry(step.target_unit).dock_frame(step.target_port)
    return (placed[step.target_unit] @ X_TD).inverse() @ placed[step.unit]


def _edges(target: TargetModel, X_DU: SE2) -> list[float]:
    """Return the longest edge [px] of each tag of the port that faces the camera, whole in its picture."""
    X_CD = target.X_UC.inverse() @ SE3.from_se2(X_DU).inverse()
    found = []
    for tag_id in target.port_tags:
        p_C = X_CD.act(target.corners_D[tag_id])
        normal = np.cross(p_C[1] - p_C[0], p_C[3] - p_C[0])
        if p_C[:, 2].min() <= 0.0 or normal @ p_C[0] >= 0.0:
            continue
        ideal = target.camera.project(p_C)
        if target.lens.shows(ideal).all():
            found.append(float(np.linalg.norm(ideal - np.roll(ideal, 1, axis=0), axis=1).max()))
    return found
