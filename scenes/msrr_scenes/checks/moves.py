"""Checks of moves: a unit ends in the arena, and where nothing stands that stays there."""

from __future__ import annotations

from collections.abc import Iterator

from msrr_scenes.arrays import Array
from msrr_scenes.checks.problems import Problem
from msrr_scenes.placement.start_regions import distance, outline, region
from msrr_scenes.specs.plan import MoveStep, ancestors
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import PoseSpec, Spread


def move_problems(scene: Scene) -> list[Problem]:
    """Return what is wrong with the poses of moves, each by itself."""
    moves = [(i, step) for i, step in enumerate(scene.plan) if isinstance(step, MoveStep)]
    return [problem for i, step in moves for problem in _pose_problems(scene, i, step.pose)]


def _pose_problems(scene: Scene, i: int, pose: PoseSpec) -> Iterator[Problem]:
    """Yield what is wrong with the pose of a move, step ``i`` of the plan, by itself."""
    if pose.frame != "world":
        yield Problem(("plan", i, "pose", "frame"), "a unit moves to a pose in the world frame; leave it out")
    if pose.spread != Spread():
        yield Problem(("plan", i, "pose", "spread"), "a unit moves to one pose, none is drawn; leave it out")
    (x0, x1), (y0, y1) = scene.arena.x_m, scene.arena.y_m
    if not (x0 <= pose.x_m <= x1 and y0 <= pose.y_m <= y1):
        arena = f"x from {x0:g} to {x1:g}, y from {y0:g} to {y1:g}"
        text = f"({pose.x_m:g}, {pose.y_m:g}) lies outside the arena: {arena}"
        yield Problem(("plan", i, "pose"), text)


def taken_ends(scene: Scene) -> Iterator[Problem]:
    """Yield moves that end too near to what stays where it is, or to the end of another unit's last move.

    A unit that stands free by then makes way, and obstacles that appear later may stand anywhere by then.
    """
    if not any(isinstance(step, MoveStep) for step in scene.plan):
        return
    least = scene.judge.min_clearance_m
    still = [name for name, body in scene.obstacles.items() if body.appears_at_s == 0.0]
    locked = {unit for dock in scene.assembled_docks for unit in (dock.unit, dock.target_unit)}
    grounds = {name: region(scene, name, outline(scene, name)) for name in (*still, *sorted(locked))}
    ends: dict[str, Array] = {}
    last = {step.unit: i for i, step in enumerate(scene.plan)}
    for i, step in enumerate(scene.plan):
        if not isinstance(step, MoveStep):
            continue
        end: Array = step.pose.nominal.act(outline(scene, step.unit))
        stays = (*still, *sorted(_locked_since_the_start(scene, i)))
        for who, body in ({repr(name): grounds[name] for name in stays} | ends).items():
            found = distance(end, body)
            if found < least:
                text = (
                    f"{step.unit!r} would stand {found:.3f} m from {who}, nearer than "
                    f"judge.min_clearance_m = {least:g}; name another pose or move the other body"
                )
                yield Problem(("plan", i, "pose"), text)
        if last[step.unit] == i:
            ends[f"the end of {step.unit!r} (plan step {i})"] = end


def _locked_since_the_start(scene: Scene, i: int) -> set[str]:
    """Return the units that are locked to others from the start to the end of step ``i``.

    They cannot make way. The unit itself leaves its port, and so may those of steps that may come before.
    """
    leave = {step.unit for j, step in enumerate(scene.plan) if j == i or i not in ancestors(scene.plan, j)}
    docks = [dock for dock in scene.assembled_docks if dock.unit not in leave]
    return {unit for dock in docks for unit in (dock.unit, dock.target_unit)}
