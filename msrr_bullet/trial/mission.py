"""The mission of a trial: which steps of the plan are under way, and the loop over all of them."""

from __future__ import annotations

from collections.abc import Callable

from msrr_bullet.profiler import Profiler
from msrr_bullet.sensors.schedule import Periodic, duration_ns
from msrr_bullet.trial.arena_judge import ArenaJudge, Safety
from msrr_bullet.trial.docking_step import DockingStep
from msrr_bullet.trial.environment import Environment
from msrr_bullet.trial.result import StepResult
from msrr_bullet.trial.telemetry import Telemetry
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import predecessors


class Mission:
    """Carries out the plan of a scene.

    A step begins when the steps that it comes after have docked, so that several may be under way at once.
    All of them sense and act, then the physics advances by one tick. A step that does not dock keeps those
    after it from beginning and does not disturb the others; what endangers bodies ends the mission.
    """

    def __init__(self, environment: Environment, telemetry: Telemetry, profiler: Profiler) -> None:
        """Prepare the mission of the environment's scene."""
        simulation = environment.simulation
        self._environment, self._telemetry, self._profiler = environment, telemetry, profiler
        self._plant = simulation.plant
        self._after = predecessors(simulation.scene.plan)
        self._deadline_ns = duration_ns(simulation.scene.time_limit_s)
        self._control = Periodic(simulation.scene.control.rate_hz, self._plant.now_ns())
        self._judge = ArenaJudge(simulation, environment.clearance, environment.locked)
        self._begun: dict[int, DockingStep] = {}
        self._active: list[DockingStep] = []

    def run(self, check_clock: Callable[[], None] = lambda: None) -> tuple[StepResult, ...]:
        """Run until no step is under way and none may begin; return the results of all that began.

        The locks are pulled at the end, when no unit can be disturbed by it.

        Args:
            check_clock: Called at every tick; it raises when the trial takes too long on the wall clock.
        """
        plant, profiler = self._plant, self._profiler
        self._begin_steps()
        while self._active:
            now_ns = plant.now_ns()
            check_clock()
            for step in self._active:
                step.sense(now_ns)
            # However slow the control is, the last instant is that at which the time is up.
            if self._control.due(now_ns) or now_ns >= self._deadline_ns:
                self._decide(now_ns)
                if not self._active:
                    break
            for step in self._active:
                step.actuate(now_ns)
            with profiler("physics"):
                plant.step()
            with profiler("judge"):
                for step in self._active:
                    step.observe(plant.now_ns())
        self._test_locks()
        return tuple(self._begun[index].result() for index in sorted(self._begun))

    def _begin_steps(self) -> None:
        """Begin every step that comes after docked steps alone."""
        for index, after in enumerate(self._after):
            ready = all(i in self._begun and self._begun[i].outcome is Outcome.DOCKED for i in after)
            if ready and index not in self._begun:
                step = DockingStep(self._environment, index, self._telemetry.recorder, self._profiler)
                self._begun[index] = step
                self._active.append(step)

    def _decide(self, now_ns: int) -> None:
        """Let all robots decide, judge the instant, and end and begin steps."""
        for step in self._active:
            step.decide(now_ns)
        with self._profiler("clearance"):
            safety = self._judge.check(step.judge for step in self._active)
        for step in self._active:
            if safety.nearest is not None:
                step.note_clearance(safety.nearest.distance)
        with self._profiler("log"):
            self._telemetry.report(self._environment, now_ns, self._active, safety.nearest)
        if safety.outcome is not None:
            self._abort(safety, safety.outcome)
            return
        ended = [step for step in self._active if step.end_if_over(now_ns)]
        for step in ended:
            self._active.remove(step)
            if step.outcome is Outcome.DOCKED:
                self._environment.locked.add(step.step)
            else:
                self._telemetry.verdict(now_ns, step)
        if ended:
            self._begin_steps()

    def _abort(self, safety: Safety, outcome: Outcome) -> None:
        """End all steps; those whose units are to blame get the outcome."""
        active, self._active = self._active, []
        for step in active:
            step.end(outcome if step.step.unit in safety.units else Outcome.ABORTED)
        for step in self._begun.values():
            if outcome is Outcome.LOCK_FAILED and step.step.unit in safety.units:
                step.outcome = outcome
        if not any(step.outcome is outcome for step in self._begun.values()):
            active[0].outcome = outcome  # no unit under way is to blame: the first one stands for the trial
        for step in self._begun.values():
            if step.outcome is not Outcome.DOCKED:
                self._telemetry.verdict(self._plant.now_ns(), step)

    def _test_locks(self) -> None:
        for step in self._begun.values():
            if step.outcome is Outcome.DOCKED:
                step.test_lock(self._control)
                self._telemetry.verdict(self._plant.now_ns(), step)
