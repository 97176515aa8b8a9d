"""The loop of a trial over physics, sensors, robots and judges, and the mission of units on their own."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Collection, Mapping

from msrr_bullet.log.records import JUDGE, Level
from msrr_bullet.profiler import Profiler
from msrr_bullet.replay.recorded_robot import RecordedRobot
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.fail_safe import FailSafeRobot
from msrr_bullet.sensors.schedule import Periodic, duration_ns
from msrr_bullet.trial.arena_judge import ArenaJudge, Safety
from msrr_bullet.trial.docking_step import DockingStep
from msrr_bullet.trial.environment import Environment
from msrr_bullet.trial.judge import Judge
from msrr_bullet.trial.result import MissionFigures
from msrr_bullet.trial.step_result import StepResult
from msrr_bullet.trial.telemetry import Telemetry
from msrr_bullet.trial.unit_runner import UnitRunner
from msrr_bullet.trial.verdict import Verdict
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import in_order


class MissionLoop(ABC):
    """A loop in which units sense and act, then the physics advances until something is due again.

    Attributes:
        ended: What ended the mission, where that was not the end of a step: danger, the time limit, or the
            base station; None while nothing did.
        failed_lock: Which lock, closed since the start, has failed the pull test; None while none has.
        ended_ns: Time at which the mission ended, before the locks are pulled.
    """

    def __init__(self, environment: Environment, telemetry: Telemetry, profiler: Profiler) -> None:
        """Prepare the mission of the environment's scene."""
        simulation = environment.simulation
        self._environment, self._telemetry, self._profiler = environment, telemetry, profiler
        self._scene, self._plant = simulation.scene, simulation.plant
        self._deadline_ns = duration_ns(self._scene.time_limit_s)
        self._control = Periodic(self._scene.control.rate_hz, self._plant.now_ns())
        self._arena = ArenaJudge(simulation, environment.clearance, environment.locked)
        self._begun: list[DockingStep] = []
        self._active: list[DockingStep] = []
        self._unparted: list[Judge] = []  # of steps that have ended, their units not yet clear of the port
        self._over = False
        self.ended: Verdict | None = None
        self.failed_lock: str | None = None
        self.ended_ns = 0

    def run(self, check_clock: Callable[[], None] = lambda: None) -> None:
        """Run until nothing is under way and nothing may begin.

        The locks are pulled at the end, when no unit can be disturbed by it. ``check_clock`` is called before
        every advance of the physics; it raises when the trial takes too long on the wall clock.
        """
        plant, profiler = self._plant, self._profiler
        while not self._over:
            now_ns = plant.now_ns()
            check_clock()
            self._sense(now_ns)
            # However slow the control is, the last instant is that at which the time is up.
            if self._control.due(now_ns) or now_ns >= self._deadline_ns:
                self._decide(now_ns)
                if self._over:
                    break
            self._actuate(now_ns)
            next_ns = min(self._next_ns(), self._control.next_ns, self._deadline_ns)
            with profiler("physics"):
                plant.advance(next_ns, self._observer())
        self.ended_ns = plant.now_ns()
        with profiler("physics"):
            self._test_locks()

    def results(self) -> tuple[StepResult, ...]:
        """Return the results of all steps that began, in the order of the plan."""
        return tuple(step.result() for step in sorted(self._begun, key=lambda step: step.index))

    def _test_locks(self) -> None:
        """Pull at every lock that holds a pair at the end, and report the verdicts on all docks."""
        plant, dockings = self._plant, self._newest_dockings()
        closed = {dock: dockings.get(dock.unit) for dock in self._environment.locked.steps}
        for step in self._begun:
            if step.outcome is Outcome.DOCKED and step not in closed.values():  # the unit has left again
                self._telemetry.verdict(plant.now_ns(), step)
        for dock, last in closed.items():
            if last is None:  # the pair was assembled at the start: no step has closed its lock
                if not (plant.lock_engaged(dock.unit) and plant.pull_test(dock.unit)):
                    lock = f"the lock of {dock.unit} at {dock.to}, closed since the start,"
                    self.failed_lock = f"{lock} failed the pull test"
                    self._telemetry.event(plant.now_ns(), JUDGE, f"{dock}: lock_failed", Level.WARNING)
            elif last.outcome is Outcome.DOCKED:
                last.test_lock(self._control, self._report_truth)
                self._telemetry.verdict(plant.now_ns(), last)

    def _newest_dockings(self) -> dict[str, DockingStep]:
        """Return the step in which each unit has begun to dock last, by the name of the unit."""
        return {step.step.unit: step for step in self._begun if not step.undocks}

    def _report_truth(self, now_ns: int) -> None:
        """Report where all bodies are at an instant after the end of the mission."""
        self._telemetry.report(now_ns, self._environment.simulation.poses(), (), None)

    def _observer(self) -> Callable[[], None] | None:
        """Return what is called after every tick until the next control instant, if anything has to be."""
        watching = [step for step in self._active if step.watches()]
        if not watching:
            return None

        def observe() -> None:
            with self._profiler("judge"):
                for step in watching:
                    step.observe(self._plant.now_ns())

        return observe

    def figures(self) -> MissionFigures | None:
        """Return the figures of a mission that a base station led; None for a plan."""
        return None

    @abstractmethod
    def _next_ns(self) -> float:
        """Return the time at which something is sensed, arrives or is sent next [ns], control apart."""

    @abstractmethod
    def _sense(self, now_ns: int) -> None:
        """Make the measurements that are due and deliver the messages that have arrived."""

    @abstractmethod
    def _decide(self, now_ns: int) -> None:
        """Let robots decide, judge the instant, and end and begin steps."""

    @abstractmethod
    def _actuate(self, now_ns: int) -> None:
        """Command drives and locks."""

    def _judge(self, now_ns: int) -> list[DockingStep] | None:
        """Judge and report an instant; return the steps that have ended, None if the whole mission has."""
        with self._profiler("clearance"):
            poses = self._environment.simulation.poses()
            self._unparted = [judge for judge in self._unparted if not judge.parted()]
            judges = [*(step.judge for step in self._active), *self._unparted]
            matters = math.inf if self._telemetry.is_heard else self._clearance_that_matters()
            safety = self._arena.check(poses, judges, matters)
        for step in self._active:
            if safety.nearest is not None:
                step.note_clearance(safety.nearest.distance)
        self._note(now_ns, poses, safety)
        if safety.verdict is not None:
            self._end(safety.verdict, safety.units)
            return None
        ended = [step for step in self._active if step.end_if_over(now_ns)]
        for step in ended:
            self._retire(step, now_ns)
        return ended

    def _retire(self, step: DockingStep, now_ns: int) -> None:
        """Judge a step that has ended no more; its pair is locked from now on, or has still to part."""
        self._active.remove(step)
        if step.outcome is Outcome.DOCKED or (step.undocks and self._plant.lock_engaged(step.step.unit)):
            self._environment.locked.add(step.step)
        else:
            self._unparted.append(step.judge)
        if step.outcome is not Outcome.DOCKED:  # the pull test has yet to tell
            self._telemetry.verdict(now_ns, step)

    def _clearance_that_matters(self) -> float:
        """Return the clearance below which one would be noted [m]."""
        return max((step.min_clearance for step in self._active), default=0.0)

    def _note(self, now_ns: int, poses: Mapping[str, SE2], safety: Safety) -> None:
        """Report an instant, at which the true poses of all bodies are these."""
        with self._profiler("log"):
            self._telemetry.report(now_ns, poses, self._active, safety.nearest)

    def _end(self, verdict: Verdict, units: Collection[str] = ()) -> None:
        """End the mission and all steps: they are aborted, but for those of the units whose doing it is.

        A lock that has opened fails the step that had closed it, which has ended before.
        """
        judged, self._active = self._active, []
        self.ended, self._over = verdict, True
        for step in judged:
            own = step.step.unit in units
            step.end(verdict if own else Verdict(Outcome.ABORTED, verdict.reason))
        if verdict.outcome is Outcome.LOCK_FAILED:
            closed = [step for unit, step in self._newest_dockings().items() if unit in units]
            for step in closed:
                step.verdict = verdict
            judged = [*judged, *closed]
        for step in judged:
            self._telemetry.verdict(self._plant.now_ns(), step)


class PlannedMission(MissionLoop):
    """Carries out the plan of a scene by units on their own, one after another.

    A step begins when the one before it has docked; one that does not dock ends the mission.
    """

    def __init__(self, environment: Environment, telemetry: Telemetry, profiler: Profiler) -> None:
        """Begin the first step of the plan of the environment's scene."""
        super().__init__(environment, telemetry, profiler)
        self._waiting = deque(in_order(self._scene.docks))
        self._begin_next()

    def _begin_next(self) -> None:
        if self._waiting:
            index = self._waiting.popleft()
            step = begin_planned(self._environment, index, self._telemetry, self._profiler)
            self._begun.append(step)
            self._active.append(step)

    def _next_ns(self) -> float:
        return self._active[0].runner.next_ns

    def _sense(self, now_ns: int) -> None:
        self._active[0].runner.sense(now_ns)

    def _decide(self, now_ns: int) -> None:
        step = self._active[0]
        step.follow(step.runner.decide(now_ns))
        if self._judge(now_ns) and step.outcome is Outcome.DOCKED:
            self._begin_next()
        self._over = not self._active

    def _actuate(self, now_ns: int) -> None:
        self._active[0].runner.actuate(now_ns)


def begin_planned(
    environment: Environment, index: int, telemetry: Telemetry, profiler: Profiler
) -> DockingStep:
    """Begin a step of the plan with a new robot that is on its own."""
    simulation, recorder = environment.simulation, telemetry.recorder
    told, step = simulation.scene.told(), simulation.scene.docks[index]
    robot = FailSafeRobot(lambda: Autonomy(told, step, profiler))
    recorded = RecordedRobot(robot, step.unit, recorder, simulation.plant.now_ns)
    runner = UnitRunner(environment, step.unit, recorded if telemetry.is_heard else robot, profiler)
    begun = DockingStep(environment, index, step, robot, runner, recorder)
    runner.start(step, environment.devices.cameras(step, begun.judge.X_DU, profiler))
    return begun
