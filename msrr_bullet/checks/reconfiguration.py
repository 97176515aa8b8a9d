"""The check that units which begin assembled can take the shapes of their mission where they stand."""

from __future__ import annotations

from msrr_bullet.base_station.base_station import coordination_setup, mission_of
from msrr_control.coordination.mission import Mission
from msrr_control.shapes.reconfiguration import assembly_ports, reconfiguration_tasks
from msrr_scenes.checks.problems import dotted
from msrr_scenes.errors import SceneError
from msrr_scenes.placement.placement import nominal_units
from msrr_scenes.specs.scene import Scene


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
