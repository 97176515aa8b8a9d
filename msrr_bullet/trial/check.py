"""The check of a scene before any trial: all that a trial would build is built once, and nothing is run."""

from __future__ import annotations

from collections.abc import Iterator

from msrr_bullet.checks.seats import check_seats
from msrr_bullet.checks.stance import check_stance
from msrr_bullet.checks.views import check_views
from msrr_bullet.log.header import LogHeader
from msrr_bullet.log.recorder import NullRecorder
from msrr_bullet.profiler import NullProfiler
from msrr_bullet.render import RENDERERS, RenderContext, build_renderer
from msrr_bullet.render.raster.bodies import LoadedBodies
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.simulation.world import BulletWorld
from msrr_bullet.trial.environment import open_environment
from msrr_bullet.trial.mission import begin_planned
from msrr_bullet.trial.telemetry import Telemetry
from msrr_bullet.trial.trial import begin_mission
from msrr_control.sequence.feasibility import check_sequence
from msrr_control.staging.feasibility import check_assembly, check_overhead, check_time
from msrr_control.staging.registry import ASSEMBLERS
from msrr_scenes.errors import ChangedFileError, MsrrError, ProgramFailedError, SceneError
from msrr_scenes.loading.load import check_scene, placed
from msrr_scenes.registry import resolve
from msrr_scenes.specs.plan import in_order
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec
from msrr_scenes.temporary_files import NoRoomError


def check_trial(scene: Scene) -> None:
    """Refuse a scene of which a trial could not be built, whatever its seed.

    The world, the devices and, for every step of the plan, the robot and its cameras are built as a trial
    builds them; for a mission of a base station, the programs of each unit at a port of another one. What a
    scene names without using it has to exist as well: the renderer of parametric cameras, the assembler of a
    scene without an overhead camera.

    Raises:
        SceneError: The scene contradicts itself, something that it names does not exist or does not take its
            parameters, or a URDF lacks what the plant needs. The message begins with the place of the key at
            fault, or with the file.
        ProgramFailedError: A class that the scene names by its import path fails while it is built.
        ChangedFileError: That class was edited since this process imported it.
        NoRoomError: The folder of temporary files is full.
    """
    check_scene(scene)
    try:
        _check(scene)
    except (ProgramFailedError, NoRoomError, ChangedFileError):
        raise
    except MsrrError as error:
        raise SceneError(placed(scene, str(error))) from error


def _check(scene: Scene) -> None:
    check_sequence(scene)
    check_overhead(scene)
    resolve("control.assembly", scene.control.assembly.name, ASSEMBLERS)
    if scene.coordinated:
        from msrr_bullet.base_station.base_station import check_mission  # for the reason in begin_mission

        check_mission(scene)
    else:
        check_assembly(scene)
        check_time(scene)
    LogHeader.of(scene, 0, {})
    for key, camera in _cameras(scene):
        resolve(f"{key}.renderer", camera.renderer.name, RENDERERS)
    telemetry = Telemetry(NullRecorder(), scene)
    with open_environment(scene, 0) as environment:
        world = environment.simulation.world
        bodies = _drawn(scene, world)
        check_views(scene, world, bodies)
        if scene.coordinated:
            from msrr_bullet.checks.assembled import check_ports, check_reconfiguration
            from msrr_bullet.robot.unit_programs import check_programs

            begin_mission(environment, telemetry, NullProfiler())
            check_ports(scene)
            check_reconfiguration(scene)
            check_programs(scene.told())
        for index in () if scene.coordinated else in_order(scene.docks):
            step = begin_planned(environment, index, telemetry, NullProfiler())
            if step.robot.failure is not None:
                raise step.robot.failure
            environment.locked.add(step.step)
        if scene.plant == "bullet" and world is not None:
            check_stance(world)
            check_seats(scene, world)


def _cameras(scene: Scene) -> Iterator[tuple[str, CameraSpec]]:
    """Yield the cameras of a scene with their keys."""
    for name, spec in scene.cameras:
        if isinstance(spec, CameraSpec):
            yield f"cameras.{name}", spec


def _drawn(scene: Scene, world: BulletWorld | None) -> LoadedBodies | None:
    """Build the renderers of a scene, and return the bodies that its raster renderers draw; None without one.

    Raises:
        GeometryError: A body has a visual shape that cannot be drawn.
    """
    if world is None or scene.perception != "images":
        return None
    renderers = [
        build_renderer(camera.renderer, RenderContext(world.client, camera.samples), f"{key}.renderer")
        for key, camera in _cameras(scene)
    ]
    return LoadedBodies(world.client) if any(isinstance(r, RasterRenderer) for r in renderers) else None
