"""Checks of overlaps, the arena and the cameras' views, over every possible start."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping

import numpy as np

from msrr_scenes.geometry.pinhole import optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.loading.problems import Problem
from msrr_scenes.placement.placement import close_range_steps, nominal_units, target_in_cone
from msrr_scenes.placement.start_regions import may_overlap, outline, region
from msrr_scenes.specs.scene import Scene


def geometry_problems(scene: Scene) -> list[Problem]:
    """Return overlaps, bodies outside the arena or unseen, and targets too wide for the cone."""
    placed = [*_overlaps(scene), *_outside(scene)]
    return [*placed, *_too_wide(scene), *(() if placed else _unseen(scene))]


def _path(scene: Scene, name: str) -> tuple[str, ...]:
    return ("units" if name in scene.units else "obstacles", name, "pose")


def _spread(scene: Scene, *names: str) -> str:
    bodies = [scene.units.get(n) or scene.obstacles[n] for n in names]
    wide = any(b.pose.spread.x_m or b.pose.spread.y_m or b.pose.spread.yaw_deg for b in bodies)
    return " for some start within its spread" if wide else ""


def _overlaps(scene: Scene) -> Iterator[Problem]:
    # Bodies have moved by the time a late obstacle appears, so only the trial can check it.
    late = {name for name, body in scene.obstacles.items() if body.appears_at_s > 0.0}
    for a, b in itertools.combinations([*scene.units, *scene.obstacles], 2):
        if not {a, b} & late and may_overlap(scene, a, b):
            text = f"overlaps {a!r}{_spread(scene, a, b)}; move them apart or narrow the spread"
            yield Problem(_path(scene, b), text)


def _outside(scene: Scene) -> Iterator[Problem]:
    (x0, x1), (y0, y1) = scene.arena.x_m, scene.arena.y_m
    for name in (*scene.units, *scene.obstacles):
        reached = region(scene, name, outline(scene, name))
        lo, hi = reached.min(axis=0), reached.max(axis=0)
        if lo[0] < x0 or lo[1] < y0 or hi[0] > x1 or hi[1] > y1:
            text = (
                f"reaches outside the arena{_spread(scene, name)}: x {lo[0]:.2f} .. {hi[0]:.2f} of "
                f"{x0:g} .. {x1:g}, y {lo[1]:.2f} .. {hi[1]:.2f} of {y0:g} .. {y1:g}; "
                "move it or enlarge the arena"
            )
            yield Problem(_path(scene, name), text)


def _too_wide(scene: Scene) -> Iterator[Problem]:
    # At contact the edges have to lie inside the inner bound, or the correction keeps the unit off the port.
    los = scene.los
    for i, step in enumerate(scene.plan):
        geometry = scene.geometry(step.unit)
        reach = geometry.control_offset(step.port) - float(geometry.frame("camera").p[0])
        if los.angle_at_contact(reach) >= los.inner:
            widest = (reach + los.setback_m) * math.tan(los.inner)
            text = (
                f"the target of plan step {i} ({step.unit} to {step.to}) is too wide for the cone: "
                f"at contact its edges are at {math.degrees(los.angle_at_contact(reach)):.1f} deg, the "
                f"inner bound is {los.inner_deg:g}; lower half_width_m below {widest:.4f}, or raise inner_deg"
            )
            yield Problem(("los", "half_width_m"), text)


def _unseen(scene: Scene) -> Iterator[Problem]:
    placed = nominal_units(scene)
    steps = close_range_steps(scene)
    aimed: set[str] = set()
    for unit, step in steps.items():
        target = scene.geometry(step.target_unit).dock_frame(step.target_port)
        X_DU = (placed[step.target_unit] @ target).inverse() @ placed[unit]
        if target_in_cone(X_DU, scene.geometry(unit), scene.los):
            aimed |= {unit, step.target_unit}
            continue
        text = (
            f"does not have its target {step.to} inside the outer cone of {scene.los.outer_deg:g} deg at the "
            "middle of its start; turn it towards the port, or give an overhead camera and a pose in another "
            "frame"
        )
        yield Problem(_path(scene, unit), text)
        aimed.add(unit)  # one problem per unit is enough
    for unit in scene.units:
        if unit in aimed or _seen_from_above(scene, unit) or _seen_by_another(scene, unit, placed):
            continue
        where = (
            "cameras.overhead is null" if scene.cameras.overhead is None else "it is out of the overhead view"
        )
        text = f"no camera sees this unit at the start ({where}, no onboard camera has a tag of it in view)"
        yield Problem(_path(scene, unit), f"{text}; move it, or add or move the overhead camera")


def _seen_from_above(scene: Scene, unit: str) -> bool:
    camera = scene.cameras.overhead
    geometry = scene.geometry(unit)
    if camera is None or "tag_top" not in geometry.frames:
        return False
    p_U = geometry.frame("tag_top").act(tag_corners(scene.tag_size("tag_top")))
    p_W = region(scene, unit, p_U[:, :2])
    # Image right is world x, image down is world -y.
    depth = np.full(len(p_W), camera.height_m - float(p_U[:, 2].max()))
    p_C = np.stack([p_W[:, 0] - camera.x_m, camera.y_m - p_W[:, 1], depth], axis=1)
    return bool(camera.pinhole.sees(p_C).all())


def _seen_by_another(scene: Scene, unit: str, placed: Mapping[str, SE2]) -> bool:
    camera = scene.cameras.onboard.pinhole
    for other in scene.units:
        if other == unit:
            continue
        X_WC = SE3.from_se2(placed[other]) @ optical_pose(scene.geometry(other).frame("camera"))
        X_CU = X_WC.inverse() @ SE3.from_se2(placed[unit])
        geometry = scene.geometry(unit)
        for slot in geometry.tag_slots:
            X_CT = X_CU @ geometry.frame(slot)
            facing = float(X_CT.p @ X_CT.R[:, 2]) > 0.0
            if facing and camera.sees(X_CT.act(tag_corners(scene.tag_size(slot)))).all():
                return True
    return False
