"""Tree of nodes that the page draws of a scene: built once, then moved for every snapshot of the trial.

Truth is drawn as solid bodies, belief in orange. All dimensions come from the scene and the URDFs, except
line widths, lengths of lines of sight, and heights of drawings above the floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import meshcat.geometry as g
import numpy as np

from msrr_bullet.timeline.palette import (
    ALARM,
    BELIEF,
    CLEARANCE,
    DARK,
    FLOOR,
    GRID,
    OBSTACLE,
    PATH,
    SIGHT,
    SIGHT_RANGE,
    VIEW_FROM,
    link_colour,
    unit_colours,
)
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.viewer import shapes
from msrr_bullet.viewer.arena_belief import ArenaBelief
from msrr_bullet.viewer.commands import HIDDEN, Command, NodeState, set_object, set_property, set_transform
from msrr_bullet.viewer.mission_nodes import MissionNodes
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import R_BODY_OPTICAL
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy
from msrr_scenes.messages import LosStatus
from msrr_scenes.specs.scene import Scene

#: Length to which the frustum of the camera is drawn [m].
FRUSTUM_RANGE = 0.22
#: Spacing of the grid lines on the floor [m].
GRID_STEP = 0.25
#: Widths and heights above the floor of the driven and the believed path [m].
TRUTH_WIDTH, TRUTH_Z = 0.012, 0.0030
BELIEF_WIDTH, BELIEF_Z = 0.005, 0.0045
#: Smallest distance between two points of a drawn path [m].
PATH_STEP = 0.002
#: Heights at which the clearance, half-way up a unit, and the lines of sight are drawn [m].
CLEARANCE_Z, SIGHT_Z = 0.12, 0.0015
#: Height of the top of the ghost above the highest frame of the unit [m]. The ghost shows the estimated pose.
GHOST_MARGIN = 0.004
#: Zoom of the view, seen from correspondingly farther away.
ZOOM = 2.2


class SceneGraph:
    """Tree of nodes of one scene."""

    def __init__(self, scene: Scene) -> None:
        """Read the shapes of the scene. Nothing is drawn yet."""
        self._scene = scene
        self._geometries = {name: scene.geometry(name) for name in scene.units}
        self._docking = tuple(dict.fromkeys(step.unit for step in scene.docks))
        guard = scene.control.guard
        # The collision monitor judges by what the overhead camera shows.
        self._monitored_m = guard.slow_m if guard.enabled and scene.cameras.overhead is not None else 0.0
        self._belief = ArenaBelief(scene)
        self.mission = MissionNodes(scene)

    def build(self) -> Iterator[Command]:
        """Yield the commands that draw everything once."""
        yield from self._arena()
        for name, colour in unit_colours(self._scene).items():
            yield from self._unit(name, colour, blank=name in self._scene.covered_units)
        for name in self._docking:
            yield from self._ghost(name)
        yield from self._obstacles()
        yield from self._sight()
        yield from self._belief.build()
        yield from self.mission.build()
        for node, colour in (("clearance/free", CLEARANCE), ("clearance/monitored", ALARM)):
            yield set_object(node, g.Box([1.0, 0.006, 0.006]), shapes.flat_material(colour))
            yield set_property(node, "visible", False)

    def _arena(self) -> Iterator[Command]:
        for node in ("Grid", "Axes"):
            yield set_property(node, "visible", False)
        (x0, x1), (y0, y1) = self._scene.arena.x_m, self._scene.arena.y_m
        middle = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1), -0.01])
        yield set_object("arena/floor", g.Box([x1 - x0, y1 - y0, 0.018]), shapes.flat_material(FLOOR))
        yield set_transform("arena/floor", SE3(p=middle))
        ends = [[x, y, 0.0] for x in _grid(x0, x1) for y in (y0, y1)]
        ends += [[x, y, 0.0] for y in _grid(y0, y1) for x in (x0, x1)]
        yield shapes.line_segments("arena/grid", ends, GRID)
        border = [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]
        yield from shapes.flat_band("arena/border", border, 0.02, 0.001, DARK)

    def _unit(self, name: str, colour: int, blank: bool) -> Iterator[Command]:
        geometry = self._geometries[name]
        for i, shape in enumerate(geometry.solids):
            material = shapes.shaded_material(link_colour(shape.link, colour))
            yield from shapes.solid(f"units/{name}/{shape.link}_{i}", shape, material)
        for slot, tag_id in self._scene.tag_ids(name).items():
            size, shown = self._scene.tag_size(name, slot), None if blank else tag_id
            path, family = f"units/{name}/{slot}", self._scene.tags.tag_family
            yield from shapes.tag_plate(path, geometry.frame(slot), size, shown, family)

    def _ghost(self, name: str) -> Iterator[Command]:
        geometry = self._geometries[name]
        outline = geometry.footprint
        height = max(float(frame.p[2]) for frame in geometry.frames.values()) + GHOST_MARGIN
        closed = np.concatenate([outline, outline[:1]])
        yield set_object(
            f"ghost/{name}", shapes.extrusion(outline, height), shapes.flat_material(BELIEF, 0.12)
        )
        for level, z in (("foot", BELIEF_Z), ("top", height)):
            yield from shapes.flat_band(f"ghost/{name}/{level}", closed, BELIEF_WIDTH, z, BELIEF)
        yield set_property(f"ghost/{name}", "visible", False)

    def _obstacles(self) -> Iterator[Command]:
        for name, spec in self._scene.obstacles.items():
            path = f"obstacles/{name}"
            yield from shapes.solid(f"{path}/body", spec.solid, shapes.shaded_material(OBSTACLE))
            if spec.tag_id is not None:
                # The tag lies flat on top, readable from above: T is x right, y down, z into the tag.
                X_BT = SE3(rotation_from_rpy(math.pi, 0.0, 0.0), np.array([0.0, 0.0, spec.height_m + 0.001]))
                family = self._scene.tags.tag_family
                yield from shapes.tag_plate(f"{path}/tag", X_BT, spec.tag_m, spec.tag_id, family)
            yield set_property(path, "visible", False)

    def _sight(self) -> Iterator[Command]:
        """Draw cone and edges of the target on the floor, and the frustum of the camera."""
        los, lens = self._scene.los, self._scene.cameras.onboard.lens
        reach = SIGHT_RANGE
        bands = ((-los.outer, -los.inner, 0.10), (-los.inner, los.inner, 0.18), (los.inner, los.outer, 0.10))
        for i, (start, end, opacity) in enumerate(bands):
            yield set_object(
                f"sight/floor/cone_{i}",
                shapes.sector(start, end, reach),
                shapes.flat_material(SIGHT, opacity),
            )
        to_left, to_right = lens.field_of_view
        for side, angle in ((-1, -to_right), (1, to_left)):
            edge = reach * np.array([math.cos(angle), math.sin(angle), 0.0])
            yield shapes.line_segments(f"sight/floor/fov_{side}", [[0.0, 0.0, 0.0], edge.tolist()], SIGHT)
        ray = [[0.0, 0.0], [reach, 0.0]]
        for status, opacity in ((LosStatus.SEEN, 1.0), (LosStatus.PREDICTED, 0.35)):
            for edge_name in ("left", "right"):
                node = f"sight/floor/{edge_name}_{status.value}"
                yield from shapes.flat_band(node, ray, 0.004, 0.001, SIGHT, opacity)
        w, h = lens.camera.width - 0.5, lens.camera.height - 0.5
        ends = lens.undistorted(np.array([[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]]))
        corners = lens.camera.rays(ends) @ R_BODY_OPTICAL.T * FRUSTUM_RANGE
        rays = [point for corner in corners for point in (np.zeros(3), corner)]
        rim = [corners[k % 4] for i in range(4) for k in (i, i + 1)]
        yield shapes.line_segments("sight/camera", np.array(rays + rim), SIGHT)
        yield set_property("sight", "visible", False)

    def node_states(self, snapshot: Snapshot) -> Mapping[str, NodeState]:
        """Return the states of all moving nodes. All snapshots of a scene have the same nodes."""
        nodes: dict[str, NodeState] = {}
        for name in self._scene.units:
            X = snapshot.units.get(name)
            nodes[f"units/{name}"] = NodeState(SE3.from_se2(X)) if X else HIDDEN
        believed = {step.unit: step.estimate for step in snapshot.steps}
        for name in self._docking:
            X = believed.get(name)
            nodes[f"ghost/{name}"] = NodeState(SE3.from_se2(X)) if X else HIDDEN
        for name in self._scene.obstacles:
            X = snapshot.obstacles.get(name)
            nodes[f"obstacles/{name}"] = NodeState(SE3.from_se2(X)) if X else HIDDEN
        nodes.update(_clearance_states(snapshot, self._monitored_m))
        nodes.update(self._belief.node_states(snapshot))
        nodes.update(self.mission.node_states(snapshot))
        nodes.update(self._sight_states(snapshot))
        return nodes

    def _sight_states(self, snapshot: Snapshot) -> Iterator[tuple[str, NodeState]]:
        watched, los = snapshot.watched, None
        X_WC, X_WF, visible = SE3(), SE3(), False
        if watched is not None:
            los = watched.los
            # In a mission most units are far from their targets, and nothing would be seen for all the cones.
            visible = snapshot.mission is None or (los is not None and los.status is not LosStatus.LOST)
            X_WU = snapshot.shown.get(watched.unit)
            visible = visible and X_WU is not None
            X_WC = SE3.from_se2(X_WU or SE2()) @ self._geometries[watched.unit].frame("camera")
            X_WF = SE3.from_se2(X_WC.to_se2(), SIGHT_Z)
        yield "sight", NodeState(visible=visible)
        yield "sight/camera", NodeState(X_WC, visible=visible)
        yield "sight/floor", NodeState(X_WF, visible=visible)
        for status in (LosStatus.SEEN, LosStatus.PREDICTED):
            shown = los is not None and los.status is status
            left, right = (los.left, los.right) if shown and los else (0.0, 0.0)
            for name, angle in (("left", left), ("right", right)):
                X_FE = SE3.from_se2(SE2(yaw=angle))
                yield f"sight/floor/{name}_{status.value}", NodeState(X_FE, visible=shown)


def _grid(low: float, high: float) -> Iterator[float]:
    return (k * GRID_STEP for k in range(math.ceil(low / GRID_STEP), math.floor(high / GRID_STEP) + 1))


def _clearance_states(snapshot: Snapshot, monitored_m: float) -> Iterator[tuple[str, NodeState]]:
    """Yield the bar between the nearest points, in red below the clearance at which the monitor acts."""
    nearest = snapshot.clearance
    bar, limited = HIDDEN, False
    if nearest is not None and nearest.distance > 0.0:
        (ax, ay), (bx, by) = nearest.point_a, nearest.point_b
        X = SE2(0.5 * (ax + bx), 0.5 * (ay + by), math.atan2(by - ay, bx - ax))
        bar = NodeState(SE3.from_se2(X, CLEARANCE_Z), scale=(nearest.distance, 1.0, 1.0))
        limited = nearest.distance < monitored_m
    yield "clearance/free", HIDDEN if limited else bar
    yield "clearance/monitored", bar if limited else HIDDEN


def path_commands(name: str, points: Sequence[Array]) -> Iterator[Command]:
    """Yield the command that draws a driven (``truth...``) or believed path through points (2,) [m]."""
    if name.startswith("truth"):
        return shapes.flat_band(f"path/{name}", points, TRUTH_WIDTH, TRUTH_Z, PATH)
    return shapes.flat_band(f"path/{name}", points, BELIEF_WIDTH, BELIEF_Z, BELIEF)


def places(snapshots: Sequence[Snapshot]) -> Array:
    """Return where all bodies of some snapshots stand, shape (N, 2) [m]."""
    poses = [X for snapshot in snapshots for X in (*snapshot.shown.values(), *snapshot.obstacles.values())]
    return np.array([[X.x, X.y] for X in poses])


def framed(points: Array) -> tuple[Array, float]:
    """Return middle, shape (2,), and radius of the circle on the floor that :func:`look_at` shows [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), 0.14 + 0.5 * float(np.linalg.norm(high - low))


def look_at(points: Array) -> Iterator[Command]:
    """Yield the commands that show all of some points on the floor from the left, behind and above.

    The points have shape (N, 2) [m].
    """
    middle, radius = framed(points)
    yield set_transform("Cameras/default", SE3(p=np.array([middle[0], middle[1], 0.06])))
    # The node of the camera has its y axis up, so world (x, y, z) is (x, z, -y) there.
    away = 1.3 * ZOOM * radius * np.array(VIEW_FROM)
    camera = "Cameras/default/rotated/<object>"
    yield set_property(camera, "position", (away[0], away[2], -away[1]))
    yield set_property(camera, "zoom", ZOOM)
