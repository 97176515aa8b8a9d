"""The check, before any trial, that the long-distance phases of a scene can work at all."""

from __future__ import annotations

import math

from msrr_control.docking.controller import build_controller, promised_speed
from msrr_control.docking.law import DockSetup
from msrr_control.planning.free_space import EVERYWHERE, Disc, FreeSpace
from msrr_control.staging.registry import route_params
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.placement.placement import close_range_steps, nominal_units, split_frame
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import PoseSpec


def check_assembly(scene: Scene) -> None:
    """Refuse a scene in which the place in front of a port can never be reached.

    The check uses the poses in the scene, which a unit must not know: it belongs before a trial, not in one.
    It does not search for routes, leaves out targets that earlier steps move, and knows nothing of assemblers
    of a user's own.

    Raises:
        SceneError: The parameters are wrong, the place in front of a port lies outside the arena or is always
            occupied, or :meth:`AssemblySetup.check` refuses the scene.
    """
    params = route_params(scene.control.assembly)
    if params is None:
        return
    close_range = close_range_steps(scene)
    placed = nominal_units(scene)
    moved: set[str] = set()
    for step in scene.docks_in_order:
        setup = AssemblySetup.of(scene, step)
        if close_range.get(step.unit) is not step:
            setup.check(params.pace.cruise_mps, params.widest_obstacle_m, params.route.border_m)
            if step.target_unit not in moved:
                end = params.route.handover(placed[step.target_unit] @ scene.dock_frame(step))
                bodies = _standing_bodies(scene, step, setup, placed, moved)
                _check_end(scene, f"plan.{scene.docks.index(step)}", step, setup, end, bodies)
        moved.add(step.unit)


def check_overhead(scene: Scene) -> None:
    """Refuse an overhead camera whose pictures come too late or too seldom for a unit that drives by them.

    Raises:
        SceneError: The parameters are wrong, or a unit would stand still between two pictures.
    """
    camera, params = scene.cameras.overhead, route_params(scene.control.assembly)
    if camera is None or params is None or len(close_range_steps(scene)) == len(scene.docks) > 0:
        return
    oldest_s = 1e-3 * camera.latency_ms + 1.0 / camera.rate_hz
    if params.watch.stale_s <= oldest_s:
        raise SceneError(
            f"control.assembly.params.watch.stale_s: by an overhead camera at {camera.rate_hz:g} Hz and "
            f"{camera.latency_ms:g} ms late, a unit was last seen up to {oldest_s:.3g} s ago, and stands "
            f"still; raise it above that, found {params.watch.stale_s:g}"
        )


def check_time(scene: Scene) -> None:
    """Refuse a plan of several steps, one after another, that the time limit leaves no time for.

    From the middle of its start a step takes at least the straight way to the place in front of the port at
    cruising speed, from rest and to rest, the way from there to the seat at the speed that the controller
    promises, and the closing of the lock. A long-distance phase of a user's own may bring the unit as near to
    the seat as it likes, as fast as the drive can. A plan of one step may be cut short on purpose.

    Raises:
        SceneError: The least times of the steps add up to more than the limit.
        ProgramFailedError: A controller of a user's own fails while it is built.
    """
    if len(scene.docks) == 1:
        return
    params = route_params(scene.control.assembly)
    close_range = close_range_steps(scene)
    placed = nominal_units(scene)
    times: list[float] = []
    for step in scene.docks_in_order:
        setup = DockSetup.of(scene, step)
        promised = promised_speed(build_controller(scene.control.docking, setup), setup.limits)
        approach = promised or scene.limits.v_max_mps
        X_WD = placed[step.target_unit] @ scene.dock_frame(step)
        X_UP = scene.geometry(step.unit).port(step.port)
        X_DP = X_WD.inverse() @ placed[step.unit] @ X_UP
        if close_range.get(step.unit) is step:
            time = math.hypot(X_DP.x, X_DP.y) / approach
        elif params is None:
            time = math.hypot(X_DP.x, X_DP.y) / scene.limits.v_max_mps
        else:
            handover = params.route.handover_m
            way = math.hypot(X_DP.x + handover, X_DP.y)
            ramps = min(params.pace.ramp_s, way / params.pace.cruise_mps)
            time = way / params.pace.cruise_mps + ramps + handover / approach
        times.append(time + scene.lock.close_time_s)
        placed[step.unit] = X_WD @ X_UP.inverse()
    if sum(times) > scene.time_limit_s:
        listed = ", ".join(f"{time:.0f}" for time in times)
        raise SceneError(
            f"time_limit_s: the steps take at least {listed} s, the whole plan {sum(times):.0f} s, found "
            f"{scene.time_limit_s:g}; raise it, or leave out a step"
        )


def _check_end(
    scene: Scene, where: str, step: DockStep, setup: AssemblySetup, end: SE2, bodies: list[Disc]
) -> None:
    """Refuse a place in front of the port that is outside the arena or always occupied."""
    spread = _largest_shift(scene, scene.units[step.target_unit].pose)
    x0, x1, y0, y1 = setup.box
    if not (x0 - spread <= end.x <= x1 + spread and y0 - spread <= end.y <= y1 + spread):
        (a0, a1), (b0, b1) = setup.arena.x_m, setup.arena.y_m
        inside = a0 - spread <= end.x <= a1 + spread and b0 - spread <= end.y <= b1 + spread
        outside = "outside the picture of the overhead camera" if inside else "outside the arena"
        mend = ", or raise cameras.overhead.height_m" if inside else ""
        raise SceneError(
            f"{where}: the place in front of {step.to}, ({end.x:z.2f}, {end.y:z.2f}), lies {outside}; turn "
            f"or move {step.target_unit!r}, or lower control.assembly.params.route.handover_m{mend}"
        )
    for disc in bodies:
        room = disc.radius + setup.half_width - spread
        space = FreeSpace(EVERYWHERE, (disc._replace(radius=room),))
        if room > 0.0 and not space.allows(end.translation[None]):
            raise SceneError(
                f"{where}: {disc.name} stands on the place in front of {step.to}, ({end.x:z.2f}, "
                f"{end.y:z.2f}); move it at least {room:.2f} m away from there"
            )


def _standing_bodies(
    scene: Scene, step: DockStep, setup: AssemblySetup, placed: dict[str, SE2], moved: set[str]
) -> list[Disc]:
    """Return the bodies that stand still, each reduced to what it covers wherever it is drawn."""
    discs = []
    for name, obstacle in scene.obstacles.items():
        if obstacle.appears_at_s > 0.0:
            continue
        X_WF = SE2()
        frame = split_frame(obstacle.pose.frame)
        if frame is not None:
            X_WF = placed[frame[0]] @ scene.geometry(frame[0]).dock_frame(frame[1])
        X_WB = X_WF @ obstacle.pose.nominal
        discs.append(Disc(name, X_WB.x, X_WB.y, obstacle.radius_m - _largest_shift(scene, obstacle.pose)))
    for name, X_WU in placed.items():
        if name not in (step.unit, step.target_unit) and name not in moved:
            radius = setup.half_width - _largest_shift(scene, scene.units[name].pose)
            discs.append(Disc(name, X_WU.x, X_WU.y, radius))
    return discs


def _largest_shift(scene: Scene, pose: PoseSpec) -> float:
    """Return how far from its nominal place a body may be drawn, including the spread of its frame [m]."""
    turn = 2.0 * math.sin(min(0.5 * math.radians(pose.spread.yaw_deg), 0.5 * math.pi))
    own = math.hypot(pose.spread.x_m, pose.spread.y_m) + turn * 1.0  # a turn shifts what is 1 m away
    frame = split_frame(pose.frame)
    return own + (_largest_shift(scene, scene.units[frame[0]].pose) if frame is not None else 0.0)
