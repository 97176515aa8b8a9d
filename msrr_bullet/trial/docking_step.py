"""One step of the plan: the loop over physics, sensors, robot and judge."""

from __future__ import annotations

from msrr_bullet.log.records import Level
from msrr_bullet.profiler import Profiler
from msrr_bullet.replay.recorded_robot import RecordedRobot
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.robot.fail_safe import FailSafeRobot
from msrr_bullet.sensors.schedule import Periodic, duration_ns
from msrr_bullet.sensors.sensor_suite import SensorSuite
from msrr_bullet.timeline.path_following_series import Instant, PathFollowingSeries
from msrr_bullet.trial.environment import Environment
from msrr_bullet.trial.judge import Judge
from msrr_bullet.trial.result import AssemblyFigures, AttemptRecord, Belief, PlanarPose, StepResult
from msrr_bullet.trial.telemetry import Telemetry
from msrr_scenes.messages import Action, Conviction, LockPosition, Phase, Twist, seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.faults import PortPlugged

_FINISHED = frozenset({Phase.DONE, Phase.FAILED})

_BELIEFS: dict[Conviction, Belief] = {
    Conviction.DOCKED: "docked",
    Conviction.GAVE_UP: "gave_up",
}

#: Time for which the robot goes on after a pull test that its lock did not hold [s], to notice it.
_WATCH_S = 0.5

#: Time for which a trial goes on after the program of the unit has failed, so that the unit comes to rest
#: [s]: the largest speed over the largest deceleration of the shipped limits, and the delay of the drive.
STOP_TIME_S = 1.5


class DockingStep:
    """One step of the plan: one unit docks to another one."""

    def __init__(
        self, environment: Environment, index: int, telemetry: Telemetry, profiler: Profiler
    ) -> None:
        """Prepare step ``index`` of the scene's plan."""
        simulation = environment.simulation
        scene, plant = simulation.scene, simulation.plant
        self._scene, self._plant = scene, plant
        self._environment, self._index = environment, index
        self._telemetry, self._profiler = telemetry, profiler
        self._step = step = scene.plan[index]
        plant.begin_dock(step)
        self._set_plug(attempt=1)
        self._judge = Judge(simulation, environment.clearance, environment.locked, step)
        self._autonomy = FailSafeRobot(lambda: Autonomy(scene, step, profiler))
        self._robot = RecordedRobot(self._autonomy, step.unit, telemetry.recorder, index, plant.now_ns)
        devices = environment.devices
        cameras = devices.cameras(step, self._judge.X_DU, profiler)
        self._sensors = SensorSuite(scene, step, plant, devices.encoders[step.unit], cameras, profiler)
        self._link = devices.links[step.unit]
        self._control = Periodic(scene.control.rate_hz, plant.now_ns())
        self._started_ns = plant.now_ns()
        self._attempts: list[AttemptRecord] = []
        self._assembly_instants: list[Instant] = []
        self._failed_ns: int | None = None  # time at which the program of the unit failed

    def run(self) -> StepResult:
        """Run until the robot finishes, the judge ends the step, or the time limit is reached."""
        plant, profiler = self._plant, self._profiler
        control = self._control
        deadline_ns = duration_ns(self._scene.time_limit_s)
        action = Action(plant.now_ns(), Phase.ASSEMBLE, attempt=1)
        while True:
            now_ns = plant.now_ns()
            self._sensors.tick(now_ns, self._robot)
            if control.due(now_ns):
                last = action
                with profiler("control"):
                    action = self._robot.step(now_ns)
                self._link.send(action)
                if action.attempt != last.attempt:
                    self._attempts.append(self._record(last, action.reason))
                    self._set_plug(action.attempt)
                with profiler("clearance"):
                    outcome, nearest = self._judge.safety(action)
                self._collect_assembly(action)
                with profiler("log"):
                    self._telemetry.report(
                        self._environment, self._index, self._judge, self._autonomy, action, nearest
                    )
                finished = action.phase in _FINISHED
                if outcome is None and not finished and now_ns >= deadline_ns:
                    outcome = Outcome.TIMEOUT
                if self._autonomy.failure is not None:
                    outcome, finished = self._stopped(now_ns, deadline_ns), False
                if outcome is not None or finished:
                    return self._end(action, outcome)
            self._actuate(now_ns)
            with profiler("physics"):
                plant.step()
            with profiler("judge"):
                self._judge.tick(plant.now_ns(), action.attempt, self._autonomy.estimate)

    def _stopped(self, now_ns: int, deadline_ns: int) -> Outcome | None:
        """Return the outcome of a unit whose program has failed, once it has had the time to come to rest."""
        if self._failed_ns is None:
            self._failed_ns = now_ns
            self._telemetry.event(now_ns, self._step.unit, str(self._autonomy.failure), Level.ERROR)
        at_rest = now_ns - self._failed_ns >= duration_ns(STOP_TIME_S)
        return Outcome.PROGRAM_FAILED if at_rest or now_ns >= deadline_ns else None

    def _collect_assembly(self, action: Action) -> None:
        """Store the true pose of the unit during the long-distance phase."""
        assembly = self._autonomy.assembly
        if assembly is not None:
            true = {self._step.unit: self._plant.pose(self._step.unit)}
            self._assembly_instants.append(Instant(action, assembly=assembly, true=true))

    def _assembly_figures(self) -> AssemblyFigures | None:
        unit = self._step.unit
        offset = self._scene.geometry(unit).control_offset(self._step.port)
        series = PathFollowingSeries.of(self._assembly_instants, unit, offset)
        if series is None:
            return None
        measures = series.measures()
        return AssemblyFigures(
            tracking_error_m=measures.get("tracking"),
            amplitude_m=measures.get("amplitude"),
            recovery_s=measures.get("recovery"),
        )

    def _actuate(self, now_ns: int) -> None:
        """Command drive and lock as the newest action says that has arrived over the link."""
        action = self._link.arrived(now_ns)
        if action is not None:
            self._plant.command(self._step.unit, action.twist)
            self._plant.set_lock(self._step.unit, action.lock)

    def _set_plug(self, attempt: int) -> None:
        """Plug the target port if the fault ``port_plugged`` says so for this attempt; else clear it."""
        target = (self._step.target_unit, self._step.target_port)
        for fault in self._scene.faults:
            if isinstance(fault, PortPlugged) and (fault.unit, fault.port) == target:
                self._plant.set_plug(fault.unit, fault.port, attempt in fault.attempts)

    def _record(self, last: Action, reason: str) -> AttemptRecord:
        estimate = self._autonomy.estimate
        return AttemptRecord(
            ended_s=seconds(last.stamp_ns),
            phase=last.phase,
            reason=reason,
            contact=self._judge.contact_in(last.attempt),
            believed=PlanarPose.of(estimate.X_DU) if estimate else None,
            true=PlanarPose.of(self._judge.X_DU()),
        )

    def _watch(self) -> None:
        """Let the robot, which stands still, sense what the pull test did; its actions change nothing."""
        plant = self._plant
        deadline_ns = plant.now_ns() + duration_ns(_WATCH_S)
        while plant.now_ns() < deadline_ns:
            now_ns = plant.now_ns()
            self._sensors.tick(now_ns, self._robot)
            if self._control.due(now_ns):
                self._robot.step(now_ns)
            plant.step()

    def _end(self, action: Action, outcome: Outcome | None) -> StepResult:
        plant, unit = self._plant, self._step.unit
        self._attempts.append(self._record(action, action.reason))
        seating = self._judge.seating()
        closed = plant.lock_position(unit) is LockPosition.CLOSED
        engaged = plant.lock_engaged(unit)
        passed = None
        if outcome is None:
            plant.command(unit, Twist())
            if action.phase is Phase.DONE:
                passed = engaged and plant.pull_test(unit).holds
                outcome = self._judge.verdict_docked(seating, engaged, passed)
                if not passed:
                    self._watch()
            else:
                reason = self._autonomy.belief.setback
                outcome = self._judge.verdict_gave_up(reason, self._sensors.ever_detected)
        self._telemetry.verdict(plant.now_ns(), outcome)
        belief = self._autonomy.belief
        return StepResult(
            index=self._index,
            unit=unit,
            port=self._step.port,
            target=self._step.to,
            outcome=outcome,
            belief=_BELIEFS.get(belief.conviction, "undecided"),
            belief_reason=belief.reason or action.reason,
            started_s=seconds(self._started_ns),
            attempts=tuple(self._attempts),
            seating=seating,
            lock_closed=closed,
            lock_engaged=engaged,
            pull_test_passed=passed,
            min_clearance_m=self._judge.min_clearance,
            assembly=self._assembly_figures(),
        )
