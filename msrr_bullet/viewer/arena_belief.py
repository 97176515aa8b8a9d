"""Drawing of what the docking unit knows of the arena: other bodies, planned path, desired point."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from msrr_bullet.timeline.palette import BELIEF, PLAN
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.viewer import shapes
from msrr_bullet.viewer.commands import HIDDEN, Command, NodeState, set_object, set_property
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.scene import Scene

#: Widths of the outlines and of the planned path, and their heights above the floor [m].
OUTLINE_WIDTH, OUTLINE_Z = 0.006, 0.0050
PLAN_WIDTH, PLAN_Z = 0.008, 0.0025
#: Radius of the disc at the desired point, and height above the floor [m].
DESIRED_RADIUS, DESIRED_Z = 0.022, 0.0060
#: Node that holds the planned paths, and the node that the live view redraws for every new path.
PLAN_NODE, LIVE_PLAN_NODE = "plan", "plan/now"


class ArenaBelief:
    """Nodes of what the docking unit knows of the arena. A scene without an overhead camera has none."""

    def __init__(self, scene: Scene) -> None:
        """Read the shapes of the bodies."""
        self._outlines: dict[str, Array] = {}
        if scene.cameras.overhead is None:
            return
        for name in scene.units:
            outline = scene.geometry(name).footprint
            self._outlines[name] = np.concatenate([outline, outline[:1]])
        for name, spec in scene.obstacles.items():
            # The unit knows an obstacle as the circle about its footprint.
            t = np.linspace(0.0, 2.0 * math.pi, 49)
            self._outlines[name] = spec.radius_m * np.column_stack([np.cos(t), np.sin(t)])

    def build(self) -> Iterator[Command]:
        """Yield the commands that draw everything once."""
        if not self._outlines:
            return
        for name, outline in self._outlines.items():
            node = f"believed/{name}"
            yield from shapes.flat_band(node, outline, OUTLINE_WIDTH, OUTLINE_Z, BELIEF)
            yield set_property(node, "visible", False)
        yield set_object("aim", shapes.sector(0.0, 2.0 * math.pi, DESIRED_RADIUS), shapes.flat_material(PLAN))
        yield set_property("aim", "visible", False)
        yield set_property(PLAN_NODE, "visible", False)

    def node_states(self, snapshot: Snapshot) -> Iterator[tuple[str, NodeState]]:
        """Yield the state of every node. All snapshots of a scene have the same nodes."""
        if not self._outlines:
            return
        poses = _believed_poses(snapshot)
        for name in self._outlines:
            X_WB = poses.get(name)
            yield f"believed/{name}", NodeState(SE3.from_se2(X_WB)) if X_WB else HIDDEN
        follows_path = any(step.assembly is not None and step.path is not None for step in snapshot.steps)
        yield PLAN_NODE, NodeState(visible=follows_path)
        desired, first = HIDDEN, snapshot.first
        if snapshot.mission is None and first.assembly is not None and first.path is not None:
            desired = NodeState(SE3.from_se2(SE2(*first.assembly.desired, 0.0), DESIRED_Z))
        yield "aim", desired


def plan_commands(node: str, points: Sequence[tuple[float, float]]) -> Iterator[Command]:
    """Yield the command that draws a planned path through ``points`` [m]."""
    return shapes.flat_band(node, points, PLAN_WIDTH, PLAN_Z, PLAN)


def _believed_poses(snapshot: Snapshot) -> dict[str, SE2]:
    """Return where bodies are believed to be: the units under way in a mission, else all except the unit."""
    situation = snapshot.first.situation
    if snapshot.mission is not None:
        obstacles = () if situation is None else situation.obstacles
        units = {step.unit: step.estimate for step in snapshot.steps if step.estimate is not None}
        return units | {obstacle.name: obstacle.X_WB for obstacle in obstacles}
    if situation is None:
        return {}
    target = () if situation.target is None else (situation.target,)
    return {body.name: body.X_WB for body in (*target, *situation.others, *situation.obstacles)}
