"""The physics of a trial alone: the same world and the same commands, and nothing that senses or decides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

from msrr_bullet.log.recorder import NullRecorder
from msrr_bullet.profiler import Profiler
from msrr_bullet.trial.environment import open_environment
from msrr_bullet.trial.telemetry import Telemetry
from msrr_bullet.trial.trial import begin_mission
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import seconds
from msrr_scenes.specs.scene import Scene

#: Methods of a plant that change what it does next.
_COMMANDS = frozenset({"begin_dock", "command", "set_lock", "set_plug"})


@dataclass(frozen=True)
class CommandedPhysics:
    """What the physics of one trial was told to do, up to the pull tests at its end.

    Attributes:
        scene: Scene of the trial.
        seed: Seed of the trial.
        commands: Time [ns], method of the plant and its arguments, in order.
        ended_ns: Simulated time at the end, before the pull tests.
        poses: Poses of all bodies when the trial was over, after the pull tests.
    """

    scene: Scene
    seed: int
    commands: tuple[tuple[int, str, tuple[Any, ...]], ...]
    ended_ns: int
    poses: dict[str, SE2]

    def replay(self) -> tuple[float, dict[str, SE2]]:
        """Run the physics again, with nothing else.

        Returns:
            Wall-clock time per simulated second [ms], and the poses of all bodies at the end. They equal
            those of a trial without pull tests bit for bit.
        """
        with open_environment(self.scene, self.seed) as environment:
            plant = environment.simulation.plant
            started = perf_counter()
            for stamp_ns, method, arguments in self.commands:
                if plant.now_ns() < stamp_ns:
                    plant.advance(stamp_ns)
                getattr(plant, method)(*arguments)
            if plant.now_ns() < self.ended_ns:
                plant.advance(self.ended_ns)
            spent_s = perf_counter() - started
            return 1e3 * spent_s / seconds(self.ended_ns), environment.simulation.poses()


def note_commands(scene: Scene, seed: int, profiler: Profiler) -> CommandedPhysics:
    """Run a trial of a checked scene, and note what its physics is told to do."""
    with open_environment(scene, seed) as environment:
        simulation = environment.simulation
        noted = _NotedPlant(simulation.plant)
        overheard: Any = noted  # it has every method of a plant
        mission = begin_mission(
            replace(environment, simulation=replace(simulation, plant=overheard)),
            Telemetry(NullRecorder(), scene),
            profiler,
        )
        mission.run(lambda: None)
        return CommandedPhysics(scene, seed, tuple(noted.commands), mission.ended_ns, simulation.poses())


class _NotedPlant:
    """A plant that notes its commands."""

    def __init__(self, plant: Any) -> None:
        self._plant = plant
        self.commands: list[tuple[int, str, tuple[Any, ...]]] = []

    def __getattr__(self, name: str) -> Callable[..., Any]:
        method: Callable[..., Any] = getattr(self._plant, name)
        if name not in _COMMANDS:
            return method

        def noted(*arguments: Any) -> Any:
            self.commands.append((self._plant.now_ns(), name, arguments))
            return method(*arguments)

        return noted
