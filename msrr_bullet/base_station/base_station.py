"""The base station: it reads the overhead camera once for all, and leads the units over the radio."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from msrr_bullet.profiler import NullProfiler, Profiler
from msrr_control.coordination.coordinator import Coordinator
from msrr_control.coordination.embedding import fits
from msrr_control.coordination.goal_tolerance import DEFAULT_TOLERANCE, GoalTolerance
from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.planning.free_space import Bounds
from msrr_control.shapes.bodies import ACTIVE_PORT
from msrr_control.shapes.shape import Shape
from msrr_control.shapes.tasks import plan_tasks, shape_tasks
from msrr_control.staging.registry import route_params
from msrr_control.staging.setup import AssemblySetup
from msrr_control.tracks.route_params import RouteParams
from msrr_perception.detection.detector import scene_detector
from msrr_perception.detection.overhead_vision import OverheadVision
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.tracking.arena_tracker import ArenaTracker
from msrr_perception.tracking.seen_pose import SeenPoses
from msrr_scenes.checks.problems import dotted
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import OVERHEAD, ArenaEstimate, Detections, Exposure, Fetch, GlobalPose
from msrr_scenes.messages.coordination import Authority, MissionState, MissionStatus, UnitReport, UnitState
from msrr_scenes.specs.plan import MoveStep
from msrr_scenes.specs.scene import Scene

#: Name of the base station in logs.
BASE_STATION = "base_station"

#: Period with which bodies that stand still are read [frames]: once a second, because only a rare push moves
#: them, and every other second where nobody comes near who could push them.
_STANDING_EVERY = 10


class BaseStation:
    """Leads all units of a scene through its mission.

    From the scene it takes geometry, calibration, data sheets and the mission, never the poses of bodies.
    ``status`` is how it stood at the last step.
    """

    def __init__(self, scene: Scene, profiler: Profiler | None = None) -> None:
        """Begin the mission of a scene, before anything was seen or heard.

        Raises:
            SceneError: The mission cannot be carried out, or the scene has no overhead camera.
        """
        units = tuple(scene.units)
        model = OverheadModel.from_scene(scene, units)
        detector = scene_detector(scene)
        self._vision = OverheadVision(model, units, detector, standing_every=_STANDING_EVERY)
        assert scene.cameras.overhead is not None, "the model of its camera was built"
        period_s = 2.0 * _STANDING_EVERY / scene.cameras.overhead.rate_hz
        self._way_m = scene.limits.v_max_mps * period_s  # of a unit until remote bodies are read again
        self._radius_m = {unit: scene.geometry(unit).circumradius for unit in units}
        self._radius_m |= {name: spec.radius_m for name, spec in scene.obstacles.items()}
        self._tracker = ArenaTracker(model)
        self._coordinator = Coordinator(mission_of(scene), units, coordination_setup(scene))
        self._units = units
        self._profiler = profiler or NullProfiler()
        self._observed: dict[str, int] = {}  # time of the newest measurement that was passed on, by unit
        self.status: MissionStatus = self._coordinator.status(0)

    def uses_camera(self, camera: str) -> bool:
        """Return whether the base station reads the pictures of a camera now."""
        return camera == OVERHEAD and self.status.state is MissionState.RUNNING

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections:
        """Read windows of an exposure and return the detections, which are used only when received."""
        driving = {u.unit for u in self.status.units if u.state is UnitState.UNDER_WAY}
        # A dock pushes units that stand. Until they are seen to stand again, they might drive: a second
        # without a look leaves so little known of where they are that all collision monitors stop.
        driving |= self._tracker.moving()
        poses = self._tracker.poses(exposure.stamp_ns)
        return self._vision.detect(exposure, poses, fetch, driving, self._remote(poses, driving))

    def _remote(self, poses: Mapping[str, GlobalPose], driving: set[str]) -> set[str]:
        """Return the bodies that no driving unit can reach before they are read again."""
        if not poses.keys() >= driving:  # somebody drives that nobody sees
            return set()
        return {
            name
            for name, body in poses.items()
            if all(
                math.hypot(body.X_WB.x - poses[unit].X_WB.x, body.X_WB.y - poses[unit].X_WB.y)
                > self._radius_m[name] + self._radius_m[unit] + self._way_m
                for unit in driving
            )
        }

    def see(self, message: Detections | GlobalPose) -> SeenPoses:
        """Process a message of the overhead camera; return what it shows, which is for all units."""
        seen_poses = self._tracker.locate(message)
        for seen in seen_poses.poses:
            self._tracker.add(seen)
        return seen_poses

    def hear(self, report: UnitReport, now_ns: int) -> None:
        """Process a report that arrives now."""
        self._coordinator.receive(report, now_ns)

    def step(self, now_ns: int) -> list[Authority]:
        """Advance the mission and return the authorities to send, none between two due times."""
        with self._profiler("coordination"):
            self._observe(now_ns)
            authorities = self._coordinator.step(now_ns)
            self.status = self._coordinator.status(now_ns)
        return authorities

    def _observe(self, now_ns: int) -> None:
        """Pass on what was seen since the last step."""
        seen = [
            self._tracker.latest(unit)
            for unit in self._units
            if self._tracker.knows(unit) and self._tracker.seen_ns(unit) > self._observed.get(unit, -1)
        ]
        self._observed |= {pose.name: pose.stamp_ns for pose in seen}
        obstacles = self._tracker.obstacles(self._tracker.poses(now_ns))
        self._coordinator.observe(seen, now_ns, obstacles)


def check_mission(scene: Scene) -> None:
    """Refuse the mission of a scene that cannot be carried out wherever the units stand.

    Raises:
        SceneError: The mission contradicts itself, its shape cannot be built or does not fit into what the
            overhead camera sees of the arena, or a unit is sent to where it is not seen.
    """
    mission = mission_of(scene)
    setup = coordination_setup(scene)
    x0, x1, y0, y1 = setup.finder.box
    room = setup.lanes.spec.border_m
    if mission.shape is None:
        try:
            plan_tasks(mission.steps, mission.holders, setup.lanes)
        except SceneError as error:
            raise SceneError(f"plan: {error}") from error
    for k, step in enumerate(mission.steps):
        if not isinstance(step, MoveStep):
            continue
        x, y = step.pose.x_m, step.pose.y_m
        if not (x0 + room <= x <= x1 - room and y0 + room <= y <= y1 - room):
            raise SceneError(
                f"plan.{k}.pose: ({x:g}, {y:g}) does not lie {room:g} m inside of what the overhead camera "
                f"sees of the arena: x from {x0:.2f} to {x1:.2f}, y from {y0:.2f} to {y1:.2f}; name another "
                "place, or raise cameras.overhead.height_m"
            )
    shapes: list[Shape] = []
    for k in range(len(scene.shape or ())):
        assert mission.shape is not None
        shapes.append(mission.shape)
        key = dotted(scene.shape_key(k))
        try:
            shape_tasks(mission.shape, setup.lanes)
        except SceneError as error:
            raise SceneError(f"{key}: {error}") from error
        # An assembly takes another shape where it stands, which is not known here.
        if not scene.assembled and not fits(shapes, setup.lanes, setup.finder.box):
            with_root = " with its root where the shapes before it fit" if k else ""
            raise SceneError(
                f"{key}: the shape and the lanes to it do not fit{with_root} into the {x1 - x0:.2f} m by "
                f"{y1 - y0:.2f} m of the arena that the overhead camera sees; take fewer units, enlarge the "
                "arena, or raise cameras.overhead.height_m"
            )
        mission = mission.then or mission


def mission_of(scene: Scene) -> Mission:
    """Return what a scene asks of its base station.

    Raises:
        SceneError: The shape contradicts itself.
    """
    mission: Mission | None = None
    for k, spec in reversed(list(enumerate(scene.shape or ()))):
        try:
            shape = Shape.of(spec)
        except SceneError as error:
            raise SceneError(f"{dotted(scene.shape_key(k))}: {error}") from error
        mission = Mission(shape, spec.named, name=str(spec), then=mission)
    mission = mission or Mission(steps=scene.plan)
    return replace(mission, one_by_one=scene.one_by_one, holders=scene.holders)


def coordination_setup(scene: Scene) -> CoordinationSetup:
    """Return what a base station works with: geometry, parameters of routes, and the ground that is seen.

    Raises:
        SceneError: The units are not all alike, or the law of the long-distance phase has no routes.
    """
    params = route_params(scene.control.assembly)
    if params is None:
        raise SceneError(
            "control.assembly: units that a base station leads drive by 'c1' or 'c2', found "
            f"{scene.control.assembly.name!r}"
        )
    names = list(scene.units)
    first = scene.geometry(names[0])
    for name in names[1:]:
        for key in ("urdf", "frames"):
            if getattr(scene.units[name], key) != getattr(scene.units[names[0]], key):
                text = f"a base station leads units of one kind; see {names[0]!r}"
                raise SceneError(f"units.{name}.{key}: {text}")
    model = OverheadModel.from_scene(scene, names)
    setups = [AssemblySetup.without_target(scene, name, ACTIVE_PORT) for name in names]
    setups = [replace(setup, place_sigma=model.place_sigma(setup.unit, setup.box)) for setup in setups]
    # Where every unit is seen, for a large top tag is not at the edge; and where it is surely in the arena.
    box = _common(setup.box for setup in setups)
    inner = _common(setup.box_for(params.route.border_m) for setup in setups)
    routes = RouteParams(params.route, params.walls, params.pace)
    retreat_m = scene.docking.retreat_m + 0.05
    distance_error, tolerance = _distance_error(scene, model), _tolerance(scene, model)
    return CoordinationSetup.of(
        first, routes, box, retreat_m, setups[0].border, distance_error, tolerance, inner
    )


def _common(boxes: Iterable[Bounds]) -> Bounds:
    """Return the bounds that lie inside of all others: x low, x high, y low, y high [m]."""
    x0, x1, y0, y1 = zip(*boxes, strict=True)
    return max(x0), min(x1), max(y0), min(y1)


def _distance_error(scene: Scene, model: OverheadModel) -> float:
    """Return what two units that are beside each other may be nearer than they seem from above [m].

    It is as much as their collision monitors take them to be nearer.
    """
    sigma = 0.0
    for tag in model.tags.values():
        errors = model.errors.of(tag, SE2())
        if errors is not None and tag.name in scene.units:
            unit, reach = GlobalPose(tag.name, 0, SE2(), errors.own), scene.geometry(tag.name).circumradius
            arena = ArenaEstimate(0, unit, None, (), (), 0, model.errors.strain)
            sigma = max(sigma, arena.sigma_between(unit, reach, reach))
    return scene.control.guard.sigmas * sigma


def _tolerance(scene: Scene, model: OverheadModel) -> GoalTolerance:
    """Return how near the end of its route a unit has to be seen to have arrived.

    Units learn how their own tags are held on their roofs, and end their routes by that; the base station
    sees them as if the tags were held as designed.
    """
    x, y, yaw = scene.control.guard.sigmas * np.max([model.roof(unit) for unit in scene.units], axis=0)
    return DEFAULT_TOLERANCE.widened(max(x, y), yaw)
