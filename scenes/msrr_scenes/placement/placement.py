"""The start of a trial: poses of all bodies, drawn from a scene's start distributions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from msrr_scenes.errors import PlacementError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.specs.control import LosSpec
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import PoseSpec

MAX_REDRAWS = 1000

#: Port whose pose is given when a unit is placed in another port's frame.
FRONT = "front"


@dataclass(frozen=True)
class Placement:
    """The start of one trial.

    Attributes:
        units: ``X_WU`` of every unit.
        obstacles: ``X_WB`` of every obstacle.
        redraws: Number of starts that were discarded because the target lay outside the outer cone.
    """

    units: Mapping[str, SE2]
    obstacles: Mapping[str, SE2]
    redraws: int = 0


def split_frame(frame: str) -> tuple[str, str] | None:
    """Return (unit, port) of a pose's frame; None for the world."""
    if frame == "world":
        return None
    unit, _, port = frame.partition(".")
    return unit, port


def draw(pose: PoseSpec, rng: np.random.Generator) -> SE2:
    """Draw a pose in its own frame, uniformly within the half-widths of its spread."""
    # Three numbers are always drawn, so that widening one spread does not change the draws of the others.
    dx, dy, dyaw = (float(a) for a in rng.uniform(-1.0, 1.0, 3))
    s = pose.spread
    return SE2(pose.x_m + s.x_m * dx, pose.y_m + s.y_m * dy, math.radians(pose.yaw_deg + s.yaw_deg * dyaw))


def target_in_cone(X_DU: SE2, geometry: UnitGeometry, los: LosSpec) -> bool:
    """Return whether both edges of the target lie inside the outer cone; see :func:`widest_edge`."""
    return widest_edge(X_DU, geometry, los) <= los.outer


def widest_edge(X_DU: SE2, geometry: UnitGeometry, los: LosSpec) -> float:
    """Return the larger angle [rad] between the optical axis of a unit's camera and an edge of the target.

    D is the dock frame of the target.
    """
    return max(map(abs, los.edge_bearings(X_DU @ geometry.frame("camera").to_se2())))


def close_range_steps(scene: Scene) -> dict[str, DockStep]:
    """Return the first step of every unit that has to see its target from the start, by unit.

    Such a unit is placed in the frame of the port that it docks to, or docks without an overhead camera that
    could guide it there. A unit whose target is moved by an earlier step is not one of them.
    """
    steps: dict[str, DockStep] = {}
    if scene.coordinated:  # a base station guides every unit to its port
        return steps
    moved: set[str] = set()
    for step in scene.docks_in_order:
        start = scene.start_pose(step.unit)
        if (
            step.unit not in moved
            and step.target_unit not in moved
            and (start.frame == step.to or scene.cameras.overhead is None)
        ):
            steps[step.unit] = step
        moved.add(step.unit)
    return steps


def draw_placement(scene: Scene, rng_for: Callable[[str], np.random.Generator]) -> Placement:
    """Draw the start of a trial of a checked scene.

    Each body has its own stream ``start/<name>``, of which ``rng_for`` returns the generator. A unit whose
    target lies outside the outer cone (Zheng et al., eq. 22) is drawn again from the same stream.

    Raises:
        SceneError: No start inside the cone was found.
    """
    steps = close_range_steps(scene)
    units: dict[str, SE2] = {}
    redraws = 0
    pending = list(scene.units)
    while pending:
        # A unit waits for the unit in whose frame it is placed and for the target it has to see.
        ready = [u for u in pending if not _waits_for(scene, u, steps) & set(pending)]
        if not ready:
            # A unit has to see one that is placed in its own frame, so that each waits for the other.
            ready = [u for u in pending if not _waits_for(scene, u, {}) & set(pending)][:1]
        for unit in ready:
            known = {unit, *units}
            seen = [s for s in steps.values() if unit in _pair(s) <= known]
            units[unit], again = _draw_unit(scene, unit, units, seen, rng_for(f"start/{unit}"))
            redraws += again
            pending.remove(unit)
    obstacles = {
        name: base_pose(scene, body.pose, units) @ draw(body.pose, rng_for(f"start/{name}"))
        for name, body in scene.obstacles.items()
    }
    ordered = {unit: units[unit] for unit in scene.units}
    return Placement(MappingProxyType(ordered), MappingProxyType(obstacles), redraws)


def base_pose(scene: Scene, pose: PoseSpec, units: Mapping[str, SE2]) -> SE2:
    """Return ``X_WF`` of the frame F in which a pose is given, from the units placed so far."""
    frame = split_frame(pose.frame)
    if frame is None:
        return SE2()
    unit, port = frame
    return units[unit] @ scene.geometry(unit).dock_frame(port)


def nominal_units(scene: Scene) -> dict[str, SE2]:
    """Return ``X_WU`` of every unit at the middle of its start distribution."""
    units: dict[str, SE2] = {}

    def place(unit: str) -> None:
        pose = scene.start_pose(unit)
        frame = split_frame(pose.frame)
        if frame and frame[0] not in units:
            place(frame[0])
        X_PU = scene.geometry(unit).port(FRONT).inverse() if frame else SE2()
        units[unit] = base_pose(scene, pose, units) @ pose.nominal @ X_PU

    for unit in scene.units:
        if unit not in units:
            place(unit)
    return units


def _waits_for(scene: Scene, unit: str, steps: Mapping[str, DockStep]) -> set[str]:
    frame = split_frame(scene.start_pose(unit).frame)
    waits = {frame[0]} if frame else set()
    if unit in steps:
        waits.add(steps[unit].target_unit)
    return waits - {unit}


def _draw_unit(
    scene: Scene, unit: str, units: Mapping[str, SE2], seen: Sequence[DockStep], rng: np.random.Generator
) -> tuple[SE2, int]:
    """Draw a unit until the targets of these steps, of which it is one of the two units, are in the cone."""
    pose = scene.start_pose(unit)
    X_WF = base_pose(scene, pose, units)
    # In another port's frame the pose is that of the front port, in the world that of the unit itself.
    X_PU = SE2() if split_frame(pose.frame) is None else scene.geometry(unit).port(FRONT).inverse()
    for redraws in range(MAX_REDRAWS):
        X_WU = X_WF @ draw(pose, rng) @ X_PU
        if all(_sees_target(scene, step, {**units, unit: X_WU}) for step in seen):
            return X_WU, redraws
    raise PlacementError(
        f"units.{unit}.pose: none of {MAX_REDRAWS} starts has the target {seen[0].to} inside the outer cone"
        f" of {scene.los.outer_deg:g} deg; turn the unit towards it or narrow the spread"
    )


def _pair(step: DockStep) -> set[str]:
    return {step.unit, step.target_unit}


def _sees_target(scene: Scene, step: DockStep, units: Mapping[str, SE2]) -> bool:
    X_WD = units[step.target_unit] @ scene.dock_frame(step)
    return target_in_cone(X_WD.inverse() @ units[step.unit], scene.geometry(step.unit), scene.los)
