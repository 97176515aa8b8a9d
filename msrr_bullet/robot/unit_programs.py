"""The programs with which a unit that a base station leads drives its routes, one for each route."""

from __future__ import annotations

from typing import Any

from msrr_bullet.profiler import Profiler
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.overhead_localizer import OverheadLocalizer
from msrr_bullet.robot.route_program import RouteProgram
from msrr_control.shapes.bodies import ACTIVE_PORT
from msrr_control.staging.guided_assembler import GuidedAssembler
from msrr_control.staging.registry import build_guided
from msrr_control.staging.setup import AssemblySetup
from msrr_perception.estimation.calibration_memory import CalibrationMemory
from msrr_perception.pose.target import TargetModel
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


class UnitPrograms:
    """Builds the programs of one unit, which share what it learns about itself at its docks.

    ``overhead`` knows where all bodies are, from one program to the next; whoever leads the unit feeds it.
    """

    def __init__(self, scene: Scene, unit: str, profiler: Profiler | None = None) -> None:
        """Build nothing yet."""
        self._scene, self._unit, self._profiler = scene, unit, profiler
        drive = TargetModel.without_target(scene, unit, ACTIVE_PORT)
        self.overhead = OverheadLocalizer(scene, unit, drive)
        control_s, link_s = 1.0 / scene.control.rate_hz, 1e-3 * scene.link.latency_ms
        drive_s = 1.0 / scene.limits.kappa_per_s + scene.as_built.drive.longest_lag_s
        self._reaction_s = control_s + link_s + drive_s
        self._memory = CalibrationMemory() if scene.docking.learn_seats else None

    def along_route(self) -> tuple[RouteProgram, GuidedAssembler[Any]]:
        """Return the program of a route that leads to no port, and what follows the route in it.

        Raises:
            SceneError: Parameters are wrong, or no unit that a base station leads drives by the law.
        """
        guided = self._guided(AssemblySetup.without_target(self._scene, self._unit, ACTIVE_PORT))
        self.overhead.aim(None)
        program = RouteProgram(self._scene, self._unit, guided, self.overhead, self._profiler)
        return program, guided

    def at_port(self, step: DockStep, docked: bool = False) -> tuple[Autonomy, GuidedAssembler[Any]]:
        """Return the program that docks, or undocks if the unit is docked, and what follows the route in it.

        Raises:
            UnknownNameError: The scene names something unknown.
            SceneError: Parameters are wrong, or the port shows no tags.
        """
        guided = self._guided(AssemblySetup.of(self._scene, step))
        self.overhead.aim(step)
        program = Autonomy(
            self._scene,
            step,
            self._profiler,
            guided=guided,
            overhead=self.overhead,
            docked=docked,
            memory=self._memory,
        )
        return program, guided

    def _guided(self, setup: AssemblySetup) -> GuidedAssembler[Any]:
        return build_guided(self._scene.control.assembly, setup, self._reaction_s)


def check_programs(scene: Scene) -> None:
    """Build what the units of a mission drive and dock with, which a trial builds when their routes begin.

    Raises:
        UnknownNameError: The scene names something unknown.
        SceneError: Parameters are wrong, or a port shows no tags.
    """
    for unit in scene.units:
        ports = (f"{other}.{p}" for other in scene.units for p in scene.geometry(other).passive_ports)
        port = next((p for p in ports if not p.startswith(f"{unit}.")), None)
        programs = UnitPrograms(scene, unit)
        programs.along_route()
        if port is not None:
            programs.at_port(DockStep(unit=unit, port=ACTIVE_PORT, to=port))
