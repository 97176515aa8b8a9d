"""The checks that what units which begin assembled are to do can be done where they stand."""

from __future__ import annotations

import math
from itertools import product

from msrr_bullet.base_station.base_station import coordination_setup, mission_of
from msrr_control.coordination.mission import Mission
from msrr_control.shapes.reconfiguration import assembly_ports, reconfiguration_tasks
from msrr_control.tracks.route_request import RouteRequest
from msrr_scenes.checks.problems import dotted
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.placement.placement import nominal_units
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Where routes into a port are tried from: parts of the width and depth of the ground that is seen.
_STARTS = (0.5, 0.2, 0.8)


def check_reconfiguration(scene: Scene) -> None:
    """Refuse a shape that an assembly cannot take with its root in the middle of its start distribution.

    The root stays there, also for the shapes that follow.

    Raises:
        SceneError: A shape, or a lane to it, leaves the ground that is seen, or no way leads to it there.
    """
    if not scene.assembled or not scene.shape:
        return
    stage: Mission | None = mission_of(scene)
    setup, holders = coordination_setup(scene), scene.holders
    root = next(iter(assembly_ports(holders)))
    X_WR = nominal_units(scene)[root]
    for k in range(len(scene.shape)):
        assert stage is not None
        assert stage.shape is not None
        try:
            reconfiguration_tasks(holders, stage.shape, setup.lanes, X_WR, setup.finder.box, stage.named)
        except SceneError as error:
            raise SceneError(
                f"{dotted(scene.shape_key(k))}: {error}; move units.{root}.pose, enlarge the arena, or raise "
                "cameras.overhead.height_m"
            ) from error
        holders = {place.name: f"{place.parent}.{place.port}" for place in stage.shape.places[1:]}
        stage = stage.then


def check_ports(scene: Scene) -> None:
    """Refuse a step to a port that faces the border, at an assembly that stays where it is.

    It stays if a unit that is docked in it has no step, or carries such a unit; its root is taken to be in
    the middle of its start distribution. Obstacles are not known before the trial.

    Raises:
        SceneError: No route leads to the port, wherever the unit comes from.
    """
    setup, idle = coordination_setup(scene), scene.units.keys() - {step.unit for step in scene.plan}
    stay = {
        name
        for unit, port in scene.holders.items()
        if unit in idle
        for name in (unit, port.partition(".")[0])
    }
    poses, (x0, x1, y0, y1) = nominal_units(scene), setup.finder.box
    for k, step in enumerate(scene.plan):
        if not isinstance(step, DockStep) or step.target_unit not in stay & idle:
            continue
        X_WE = setup.lanes.body.docked(poses[step.target_unit], step.target_port)
        starts = ((x0 + a * (x1 - x0), y0 + b * (y1 - y0)) for a, b in product(_STARTS, _STARTS))
        routes = (
            setup.finder.find(RouteRequest(SE2(x, y, math.atan2(X_WE.y - y, X_WE.x - x)), X_WE, dock=True))
            for x, y in starts
        )
        if all(route is None for route in routes):
            raise SceneError(
                f"plan.{k}.to: {step.to} faces the border of what the overhead camera sees of the arena, "
                "with no room for a route into it, and its assembly stays there; name another port, move the "
                "assembly, enlarge the arena, or raise cameras.overhead.height_m"
            )
