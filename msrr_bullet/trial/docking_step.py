"""One step: a unit docks or undocks, its judge watches, and what comes of it is kept."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from msrr_bullet.log import topics
from msrr_bullet.log.recorder import Recorder
from msrr_bullet.log.records import Event, Level, StepStart
from msrr_bullet.robot.fail_safe import FailSafeRobot
from msrr_bullet.sensors.schedule import Periodic, duration_ns
from msrr_bullet.timeline.path_following_series import ControlInstant, PathFollowingSeries
from msrr_bullet.trial.environment import Environment
from msrr_bullet.trial.exposure_tally import ExposureTally
from msrr_bullet.trial.judge import Judge
from msrr_bullet.trial.step_result import AssemblyFigures, AttemptRecord, PlanarPose, Seating, StepResult
from msrr_bullet.trial.step_result import Belief as BeliefName
from msrr_bullet.trial.unit_runner import UnitRunner
from msrr_bullet.trial.verdict import Verdict, time_is_up
from msrr_perception.tracking.global_estimator import pose_in_dock_frame
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Action, Belief, Conviction, LockPosition, Phase, Twist, seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.faults import PortPlugged
from msrr_scenes.specs.plan import DockStep

_BELIEFS: dict[Conviction, BeliefName] = {
    Conviction.DOCKED: "docked",
    Conviction.UNDOCKED: "undocked",
    Conviction.GAVE_UP: "gave_up",
}

#: Time for which the robot goes on after a pull test that its lock did not hold [s], to notice it.
_WATCH_S = 0.5

#: Time for which a trial goes on after the program of the unit has failed, so that the unit comes to rest
#: [s]: more than the longest stop under the shipped limits, with the delay of the drive, takes (1.3 s).
STOP_TIME_S = 1.5


class DockingStep:
    """One step: one unit docks to another one, or undocks from it.

    The mission owns the time and lets the robot decide. It calls :meth:`follow` after every decision and,
    where the step :meth:`watches`, :meth:`observe` after every tick of the physics, until the step has ended.
    ``index`` is its place in the plan, or among the steps that a base station has begun. ``min_clearance`` is
    the smallest clearance of all bodies that was noted [m], infinite before one was, and ``verdict`` that of
    the judge; None while the step is under way.
    """

    def __init__(
        self,
        environment: Environment,
        index: int,
        step: DockStep,
        robot: FailSafeRobot[Any],
        runner: UnitRunner,
        recorder: Recorder,
        *,
        undocks: bool = False,
    ) -> None:
        """Begin a step now; that of a unit that undocks is the one in which it docked."""
        simulation = environment.simulation
        scene, plant = simulation.scene, simulation.plant
        self._scene, self._plant, self._recorder = scene, plant, recorder
        self.index, self.step, self.robot, self.runner, self.undocks = index, step, robot, runner, undocks
        if not undocks:
            plant.begin_dock(step)
            self._set_plug(attempt=1)
        self.judge = Judge(simulation, environment.clearance, environment.locked, step)
        now_ns = self._started_ns = plant.now_ns()
        recorder.write(topics.STEPS, now_ns, StepStart(now_ns, index, step.unit, step.port, step.to))
        shown = robot.estimates
        self._onboard, self._overhead = ExposureTally(shown.pose), ExposureTally(shown.arena)
        self._attempts: list[AttemptRecord] = []
        self._assembly_instants: list[ControlInstant] = []
        self._deadline_ns = duration_ns(scene.time_limit_s)
        self._failed_ns: int | None = None  # time at which the program of the unit failed
        self.min_clearance = math.inf
        self._seating: Seating | None = None
        self._closed = self._engaged = False
        self._pull_test_passed: bool | None = None
        self._belief = Belief()
        self.verdict: Verdict | None = None

    @property
    def outcome(self) -> Outcome | None:
        """Outcome of the step; None while it is under way."""
        return None if self.verdict is None else self.verdict.outcome

    @property
    def action(self) -> Action:
        """Last decision of the robot."""
        return self.runner.action

    def follow(self, last: Action) -> None:
        """Take note of a decision of the robot; ``last`` is the one before."""
        action = self.action
        if action.attempt != last.attempt:
            self._attempts.append(self._record(last, action.reason))
            self._set_plug(action.attempt)
        self.judge.decide(action)
        self._onboard.add(self.robot.estimates.pose)
        self._overhead.add(self.robot.estimates.arena)
        self._collect_assembly(action)

    def watches(self) -> bool:
        """Return whether the judge has to observe every tick until the next control instant."""
        return not self.undocks and self.judge.watches(self.action.attempt)

    def observe(self, now_ns: int) -> None:
        """Let the judge observe pins and seat after a tick of the physics, while it :meth:`watches`."""
        self.judge.tick(now_ns, self.action.attempt, lambda: self.robot.estimates.pose)

    def note_clearance(self, distance: float) -> None:
        """Take note of the smallest clearance of all bodies at this instant [m]."""
        self.min_clearance = min(self.min_clearance, distance)

    def end_if_over(self, now_ns: int) -> bool:
        """End the step if the robot has finished, its program has failed or the time is up."""
        timed_out = now_ns >= self._deadline_ns
        if self.robot.failure is not None:
            if self._has_stopped(now_ns) or timed_out:
                self.end(Verdict(Outcome.PROGRAM_FAILED))
        elif self.action.phase is Phase.DONE:
            self.end(self._verdict_done())
        elif self.action.phase is Phase.FAILED:
            self.end(self._verdict_gave_up())
        elif timed_out:
            self.end(time_is_up(self._scene.time_limit_s))
        return self.verdict is not None

    def end(self, verdict: Verdict) -> None:
        """End the step with a verdict; the unit is commanded to stand still."""
        plant, unit = self._plant, self.step.unit
        self._attempts.append(self._record(self.action, self.action.reason))
        self._seating = self.judge.seating()
        self._closed = plant.lock_position(unit) is LockPosition.CLOSED
        self._engaged = plant.lock_engaged(unit)
        plant.command(unit, Twist())
        self._belief = self.robot.estimates.belief
        self.verdict = verdict
        for camera, tally in (("onboard", self._onboard), ("overhead", self._overhead)):
            if warning := tally.warning(camera):
                now_ns = plant.now_ns()
                self._recorder.write(topics.EVENTS, now_ns, Event(now_ns, unit, warning, Level.WARNING))

    def _verdict_done(self) -> Verdict:
        """Return the verdict on a robot that believes that it has docked, or undocked."""
        if self.undocks:
            return Verdict(Outcome.UNDOCKED if self._has_parted() else Outcome.STUCK)
        return self.judge.verdict_docked(self._plant.lock_engaged(self.step.unit))

    def _verdict_gave_up(self) -> Verdict:
        if self.undocks:
            return Verdict(Outcome.GAVE_UP if self._has_parted() else Outcome.STUCK)
        return self.judge.verdict_gave_up(self.robot.estimates.belief.setback, self.runner.ever_detected)

    def _has_parted(self) -> bool:
        """Return whether the unit is clear of the port and its lock holds nothing."""
        return self.judge.parted() and not self._plant.lock_engaged(self.step.unit)

    def test_lock(self, control: Periodic, report: Callable[[int], None]) -> None:
        """Pull at the lock of a pair that has docked; simulated time passes, beyond the time limit as well.

        A robot whose lock did not hold goes on for a while, to notice it; its actions change nothing.
        ``report`` is called at a control instant with its time [ns], after the decision of the robot.
        """
        plant = self._plant
        self._pull_test_passed = plant.lock_engaged(self.step.unit) and plant.pull_test(self.step.unit)
        if self._pull_test_passed:
            return
        self.verdict = Verdict(Outcome.LOCK_FAILED, "the lock failed the pull test")
        end_ns = plant.now_ns() + duration_ns(_WATCH_S)
        if not self.runner.running:  # one that a base station leads is on standby
            self.runner.start(self.step, [])
        while plant.now_ns() < end_ns:
            now_ns = plant.now_ns()
            self.runner.sense(now_ns)
            if control.due(now_ns):
                self.runner.decide(now_ns)
                report(now_ns)
            plant.step()
        self._belief = self.robot.estimates.belief

    def result(self) -> StepResult:
        """Return the result of a step that has ended."""
        assert self.verdict is not None, "the step has ended"
        belief = self._belief
        return StepResult(
            index=self.index,
            unit=self.step.unit,
            port=self.step.port,
            target=self.step.to,
            outcome=self.verdict.outcome,
            belief=_BELIEFS.get(belief.conviction, "undecided"),
            verdict_reason=self.verdict.reason,
            belief_reason=belief.reason or self._attempts[-1].reason,
            started_s=seconds(self._started_ns),
            attempts=tuple(self._attempts),
            seating=self._seating,
            lock_closed=self._closed,
            lock_engaged=self._engaged,
            pull_test_passed=self._pull_test_passed,
            min_clearance_m=self.min_clearance if math.isfinite(self.min_clearance) else None,
            assembly=self._assembly_figures(),
            undocks=self.undocks,
            onboard_exposures=self._onboard.counts,
            overhead_exposures=self._overhead.counts,
        )

    def _has_stopped(self, now_ns: int) -> bool:
        """Return whether a unit whose program has failed has had the time to come to rest."""
        if self._failed_ns is None:
            self._failed_ns = now_ns
            failed = Event(now_ns, self.step.unit, str(self.robot.failure), Level.ERROR)
            self._recorder.write(topics.EVENTS, now_ns, failed)
        return now_ns - self._failed_ns >= duration_ns(STOP_TIME_S)

    def _collect_assembly(self, action: Action) -> None:
        """Store the true pose of the unit during the long-distance phase."""
        assembly = self.robot.estimates.assembly
        if assembly is not None:
            true = {self.step.unit: self._plant.pose(self.step.unit)}
            self._assembly_instants.append(ControlInstant(action, assembly=assembly, true=true))

    def _assembly_figures(self) -> AssemblyFigures | None:
        unit = self.step.unit
        offset = self._scene.geometry(unit).control_offset(self.step.port)
        series = PathFollowingSeries.of(self._assembly_instants, unit, offset)
        if series is None:
            return None
        measures = {key: value for key, value in series.measures().items() if math.isfinite(value)}
        return AssemblyFigures(
            tracking_error_m=measures.get("tracking"),
            amplitude_m=measures.get("amplitude"),
            recovery_s=measures.get("recovery"),
        )

    def _set_plug(self, attempt: int) -> None:
        """Plug the target port if the fault ``port_plugged`` says so for this attempt; else clear it."""
        target = (self.step.target_unit, self.step.target_port)
        for fault in self._scene.faults:
            if isinstance(fault, PortPlugged) and (fault.unit, fault.port) == target:
                self._plant.set_plug(fault.unit, fault.port, attempt in fault.attempts)

    def believed(self, phase: Phase) -> SE2 | None:
        """Return the pose X_DU that the unit believes to have in a phase; None while it believes none.

        On the way from afar it goes by its pose in the arena and that of the target, later by what its own
        camera shows.
        """
        shown = self.robot.estimates
        if phase is Phase.ASSEMBLE and shown.arena is not None:
            return pose_in_dock_frame(shown.arena, self.judge.X_TD)
        return shown.pose.X_DU if shown.pose else None

    def _record(self, last: Action, reason: str) -> AttemptRecord:
        believed = self.believed(last.phase) or self.believed(Phase.ASSEMBLE)  # it gave up on its way
        return AttemptRecord(
            ended_s=seconds(last.stamp_ns),
            phase=last.phase,
            reason=reason,
            contact=self.judge.contact_in(last.attempt),
            believed=PlanarPose.of(believed) if believed else None,
            true=PlanarPose.of(self.judge.X_DU()),
        )
