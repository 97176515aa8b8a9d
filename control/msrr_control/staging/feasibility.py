"""Scenes whose long-distance phase cannot work wherever things are drawn; said before a trial is run."""

from __future__ import annotations

import math

from msrr_control.planning.free_space import Disc, FreeSpace
from msrr_control.planning.route_planner import RoutePlanner
from msrr_control.staging.parameters import AssemblyParams
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.placement.placement import close_range_steps, nominal_units, split_frame
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import PoseSpec


def check_assembly(scene: Scene, params: AssemblyParams | None = None) -> None:
    """Refuse a scene in which some step's place in front of the port can never be reached.

    It looks at where the scene puts everybody, which a unit must not: call it before a trial, not in one.
    What only a search for a way could tell is left to the trial, and so are targets that earlier steps move.

    Args:
        scene: A checked scene.
        params: Of the assembler; None for the defaults.

    Raises:
        SceneError: The place in front of a port lies outside the arena or something always stands on it, or
            what :meth:`AssemblySetup.check` refuses.
    """
    params = params if params is not None else AssemblyParams()
    starts_there = close_range_steps(scene)
    placed = nominal_units(scene)
    moved: set[str] = set()
    for i, step in enumerate(scene.plan):
        setup = AssemblySetup.of(scene, step)
        if starts_there.get(step.unit) is not step:
            setup.check(params.pace.cruise_mps, params.widest_obstacle_m, params.route.border_m)
            if step.target_unit not in moved:
                _check_end(scene, i, step, setup, params, placed, moved)
        moved.add(step.unit)


def _check_end(
    scene: Scene,
    i: int,
    step: DockStep,
    setup: AssemblySetup,
    params: AssemblyParams,
    placed: dict[str, SE2],
    moved: set[str],
) -> None:
    planner = RoutePlanner(params.route, params.walls, params.pace, setup.box, setup.offset, setup.half_width)
    target = placed[step.target_unit]
    end = planner.handover(target @ setup.X_TD)
    loose = _looseness(scene, scene.units[step.target_unit].pose)
    x0, x1, y0, y1 = setup.box
    if not (x0 - loose <= end.x <= x1 + loose and y0 - loose <= end.y <= y1 + loose):
        raise SceneError(
            f"plan.{i}: the place in front of {step.to}, ({end.x:.2f}, {end.y:.2f}), lies outside the arena; "
            f"turn or move {step.target_unit!r}, or lower control.assembly.params.route.handover_m"
        )
    for disc in _standing(scene, step, setup, placed, moved):
        room = disc.radius + setup.half_width - loose
        shut = FreeSpace((-math.inf, math.inf, -math.inf, math.inf), (disc._replace(radius=room),))
        if room > 0.0 and shut.hit(end.translation[None]) is not None:
            raise SceneError(
                f"plan.{i}: {disc.name} stands on the place in front of {step.to}, ({end.x:.2f}, "
                f"{end.y:.2f}); move it at least {room:.2f} m away from there"
            )


def _standing(
    scene: Scene, step: DockStep, setup: AssemblySetup, placed: dict[str, SE2], moved: set[str]
) -> list[Disc]:
    """Return what stands there at the start and stays, each no larger than it surely covers."""
    discs = []
    for name, obstacle in scene.obstacles.items():
        if obstacle.appears_at_s > 0.0:
            continue
        X_WF = SE2()
        frame = split_frame(obstacle.pose.frame)
        if frame is not None:
            X_WF = placed[frame[0]] @ scene.geometry(frame[0]).dock_frame(frame[1])
        X_WB = X_WF @ obstacle.pose.nominal
        discs.append(Disc(name, X_WB.x, X_WB.y, obstacle.radius_m - _looseness(scene, obstacle.pose)))
    for name, X_WU in placed.items():
        if name not in (step.unit, step.target_unit) and name not in moved:
            radius = setup.half_width - _looseness(scene, scene.units[name].pose)
            discs.append(Disc(name, X_WU.x, X_WU.y, radius))
    return discs


def _looseness(scene: Scene, pose: PoseSpec) -> float:
    """Return how far from its nominal place a body may be drawn, its frame's own spread included [m]."""
    turn = 2.0 * math.sin(min(0.5 * math.radians(pose.spread.yaw_deg), 0.5 * math.pi))
    own = math.hypot(pose.spread.x_m, pose.spread.y_m) + turn * 1.0  # a turn acts on what is 1 m away
    frame = split_frame(pose.frame)
    return own + (_looseness(scene, scene.units[frame[0]].pose) if frame is not None else 0.0)
