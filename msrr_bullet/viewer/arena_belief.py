"""What the docking unit knows of the whole arena, as the page draws it: other bodies, its path, its aim."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from msrr_bullet.timeline.palette import BELIEF, PLAN
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.viewer import shapes
from msrr_bullet.viewer.commands import Command, set_object, set_property
from msrr_bullet.viewer.nodes import HIDDEN, Placement
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import GlobalPose, ObstacleEstimate
from msrr_scenes.specs.scene import Scene

#: Widths of the outlines and of the planned path, and their heights above the floor [m].
OUTLINE_WIDTH, OUTLINE_Z = 0.006, 0.0050
PLAN_WIDTH, PLAN_Z = 0.008, 0.0025
#: Radius of the disc at the desired point, and its height above the floor [m].
AIM_RADIUS, AIM_Z = 0.022, 0.0060
#: Node that holds the planned paths, and the one that the live view draws again and again.
PLAN_NODE, PLAN_NOW = "plan", "plan/now"


class ArenaBelief:
    """Nodes of what a unit believes of the arena. A scene without an overhead camera has none."""

    def __init__(self, scene: Scene) -> None:
        """Read the shapes."""
        self._outlines: dict[str, Array] = {}
        if scene.cameras.overhead is None:
            return
        for name in scene.units:
            outline = scene.geometry(name).footprint
            self._outlines[name] = np.concatenate([outline, outline[:1]])
        for name, spec in scene.obstacles.items():
            # What is known of an obstacle is the circle about its footprint.
            t = np.linspace(0.0, 2.0 * math.pi, 49)
            self._outlines[name] = spec.radius_m * np.column_stack([np.cos(t), np.sin(t)])

    def build(self) -> Iterator[Command]:
        """Yield what is drawn once."""
        if not self._outlines:
            return
        for name, outline in self._outlines.items():
            node = f"believed/{name}"
            yield set_object(node, shapes.strip(outline, OUTLINE_WIDTH, OUTLINE_Z), shapes.ink(BELIEF))
            yield set_property(node, "visible", False)
        yield set_object("aim", shapes.sector(0.0, 2.0 * math.pi, AIM_RADIUS), shapes.ink(PLAN))
        yield set_property("aim", "visible", False)
        yield set_property(PLAN_NODE, "visible", False)

    def placements(self, snapshot: Snapshot) -> Iterator[tuple[str, Placement]]:
        """Yield where every node is; the same nodes for every snapshot of a scene."""
        if not self._outlines:
            return
        seen = {body.name: body.X_WB for body in _others(snapshot)}
        for name in self._outlines:
            X_WB = seen.get(name)
            yield f"believed/{name}", Placement(SE3.from_se2(X_WB)) if X_WB else HIDDEN
        under_way = snapshot.assembly is not None and snapshot.path is not None
        yield PLAN_NODE, Placement(visible=under_way)
        aim = HIDDEN
        if snapshot.assembly is not None and under_way:
            aim = Placement(SE3.from_se2(SE2(*snapshot.assembly.desired, 0.0), AIM_Z))
        yield "aim", aim


def plan_commands(node: str, points: Sequence[tuple[float, float]]) -> Iterator[Command]:
    """Yield the band of a planned path."""
    if len(points) > 1:
        yield set_object(node, shapes.strip(points, PLAN_WIDTH, PLAN_Z), shapes.ink(PLAN))


def _others(snapshot: Snapshot) -> Iterator[GlobalPose | ObstacleEstimate]:
    """Yield every body that the unit knows of beside itself, which has a ghost of its own."""
    if snapshot.situation is not None:
        yield snapshot.situation.target
        yield from snapshot.situation.others
        yield from snapshot.situation.obstacles
