"""The programs with which a unit that a base station leads drives its routes, one for each route."""

from __future__ import annotations

from typing import Any

from msrr_bullet.profiler import Profiler
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.route_program import RouteProgram
from msrr_control.coordination.bodies import ACTIVE_PORT
from msrr_control.staging.guided_assembler import GuidedAssembler
from msrr_control.staging.registry import build_guided
from msrr_control.staging.setup import AssemblySetup
from msrr_perception.estimation.knowledge import CalibrationMemory
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


class UnitPrograms:
    """Builds the programs of one unit, which share what it learns about itself at its docks."""

    def __init__(self, scene: Scene, unit: str, profiler: Profiler | None = None) -> None:
        """Build nothing yet.

        Args:
            scene: Geometry, data sheets and parameters.
            unit: Name of the unit.
            profiler: Measures the time of the collision monitor.
        """
        self._scene, self._unit, self._profiler = scene, unit, profiler
        control_s, link_s = 1.0 / scene.control.rate_hz, 1e-3 * scene.link.latency_ms
        self._reaction_s = control_s + link_s + 1.0 / scene.limits.kappa_per_s
        self._memory = CalibrationMemory() if scene.docking.learn_seats else None

    def along_route(self) -> tuple[RouteProgram, GuidedAssembler[Any]]:
        """Return the program of a route that leads to no port, and what follows the route in it.

        Raises:
            UnknownNameError: The scene names something unknown.
            SceneError: Parameters are wrong.
        """
        guided = self._guided(AssemblySetup.without_target(self._scene, self._unit, ACTIVE_PORT))
        return RouteProgram(self._scene, self._unit, ACTIVE_PORT, guided, self._profiler), guided

    def at_port(self, step: DockStep, docked: bool = False) -> tuple[Autonomy, GuidedAssembler[Any]]:
        """Return the program that docks, or undocks if the unit is docked, and what follows the route in it.

        Raises:
            UnknownNameError: The scene names something unknown.
            SceneError: Parameters are wrong, or the port shows no tags.
        """
        guided = self._guided(AssemblySetup.of(self._scene, step))
        memory = self._memory
        program = Autonomy(self._scene, step, self._profiler, guided=guided, docked=docked, memory=memory)
        return program, guided

    def _guided(self, setup: AssemblySetup) -> GuidedAssembler[Any]:
        return build_guided(self._scene.control.assembly, setup, self._reaction_s)
