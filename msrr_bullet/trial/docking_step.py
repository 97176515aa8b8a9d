"""One step of the plan: the loop in which physics, sensors, robot and judge meet."""

from __future__ import annotations

from dataclasses import dataclass

from msrr_bullet.collision.clearance_model import Clearance
from msrr_bullet.profiler import Profiler
from msrr_bullet.replay.recorded_robot import RecordedRobot
from msrr_bullet.robot.autonomy import Autonomy
from msrr_bullet.sensors.camera_sensors import (
    CameraSensor,
    ParametricOnboardCamera,
    ParametricOverheadCamera,
    RenderedCameraSensor,
)
from msrr_bullet.sensors.schedule import Periodic, duration_ns
from msrr_bullet.sensors.sensor_suite import SensorSuite
from msrr_bullet.timeline.path_following_series import Instant, PathFollowingSeries
from msrr_bullet.trial.environment import Stage
from msrr_bullet.trial.judge import Judge
from msrr_bullet.trial.result import AssemblyFigures, AttemptRecord, Contact, PlanarPose, Seating
from msrr_bullet.trial.telemetry import Telemetry
from msrr_scenes.messages import Action, Belief, LockPosition, Phase, Twist, seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.faults import PortPlugged

_OVER = frozenset({Phase.DONE, Phase.FAILED})


@dataclass(frozen=True)
class StepResult:
    """How a step of the plan ended.

    Attributes:
        outcome: The judge's verdict.
        belief: The robot's.
        action: Its last decision.
        contact: First touch of the deciding attempt.
        seating: How the pair stood, before the pull test.
        lock_closed: What the cam says.
        lock_engaged: Whether it holds.
        pull_test_passed: None when there was none.
        min_clearance_m: Smallest distance between bodies that were not docking.
        assembly: Figures of the long-distance phase; None without one.
        records: One for each attempt.
    """

    outcome: Outcome
    belief: Belief
    action: Action
    contact: Contact | None
    seating: Seating | None
    lock_closed: bool
    lock_engaged: bool
    pull_test_passed: bool | None
    min_clearance_m: float | None
    assembly: AssemblyFigures | None
    records: tuple[AttemptRecord, ...]


class DockingStep:
    """Runs one step of the plan to its end."""

    def __init__(self, stage: Stage, index: int, narrator: Telemetry, clock: Profiler) -> None:
        """Prepare step ``index`` of the scene's plan."""
        scene, plant = stage.scene, stage.plant
        self._stage, self._index, self._narrator, self._clock = stage, index, narrator, clock
        self._step = step = scene.plan[index]
        plant.begin_dock(step)
        self._plug(attempt=1)
        self._judge = Judge(stage, step)
        # The tap records what goes in and out; the robot itself is asked for nothing else.
        self._robot = RecordedRobot(
            Autonomy(scene, step, clock), step.unit, narrator.recorder, index, plant.now_ns()
        )
        self._hardware = SensorSuite(stage, step, self._eyes(), clock)
        self._link = stage.links[step.unit]
        self._records: list[AttemptRecord] = []
        self._way: list[Instant] = []

    def run(self) -> StepResult:
        """Run until the robot is done, the judge ends it, or time is up."""
        stage, plant = self._stage, self._stage.plant
        control = Periodic(stage.scene.control.rate_hz, plant.now_ns())
        deadline_ns = duration_ns(stage.scene.time_limit_s)
        action = Action(plant.now_ns(), Phase.ASSEMBLE, attempt=1)
        while True:
            now_ns = plant.now_ns()
            self._hardware.tick(now_ns, self._robot)
            if control.due(now_ns):
                before = action
                with self._clock("control"):
                    action = self._robot.step(now_ns)
                self._link.send(action)
                if action.attempt != before.attempt:
                    self._records.append(self._record(before, action.reason))
                    self._plug(action.attempt)
                with self._clock("clearance"):
                    outcome, nearest = self._judge.safety(action)
                self._note_way(action)
                self._tell(action, nearest)
                over = action.phase in _OVER
                if outcome is None and not over and now_ns >= deadline_ns:
                    outcome = Outcome.TIMEOUT
                if outcome is not None or over:
                    return self._end(action, outcome)
            self._actuate(now_ns)
            with self._clock("physics"):
                plant.step()
            with self._clock("judge"):
                self._judge.tick(plant.now_ns(), action.attempt, self._robot.estimate)

    def _note_way(self, action: Action) -> None:
        """Keep what the figures of the long-distance phase are made of."""
        assembly = self._robot.assembly
        if assembly is not None:
            unit = self._step.unit
            true = {unit: self._stage.plant.pose(unit)}
            self._way.append(Instant(action, assembly=assembly, true=true))

    def _figures(self) -> AssemblyFigures | None:
        unit = self._step.unit
        offset = self._stage.scene.geometry(unit).control_offset(self._step.port)
        series = PathFollowingSeries.of(self._way, unit, offset)
        if series is None:
            return None
        found = series.measures()
        return AssemblyFigures(
            tracking_error_m=found.get("tracking"),
            amplitude_m=found.get("amplitude"),
            recovery_s=found.get("recovery"),
        )

    def _tell(self, action: Action, nearest: Clearance | None) -> None:
        with self._clock("log"):
            self._narrator.instant(
                self._stage, self._index, self._step, self._judge, self._robot, action, nearest
            )

    def _actuate(self, now_ns: int) -> None:
        arrived = self._link.arrived(now_ns)
        if arrived is not None:
            self._stage.plant.command(self._step.unit, arrived.twist)
            self._stage.plant.set_lock(self._step.unit, arrived.lock)

    def _eyes(self) -> list[CameraSensor]:
        stage, step, clock = self._stage, self._step, self._clock
        above = stage.scene.cameras.overhead is not None
        if stage.scene.perception == "parametric":
            front: CameraSensor = ParametricOnboardCamera(stage, step, self._judge.X_DU)
            return [ParametricOverheadCamera(stage), front] if above else [front]
        front = RenderedCameraSensor.onboard(stage, step, clock)
        return [RenderedCameraSensor.overhead(stage, step, clock), front] if above else [front]

    def _plug(self, attempt: int) -> None:
        """Put the fault ``port_plugged`` into force for this attempt, or out of it."""
        target = (self._step.target_unit, self._step.target_port)
        for fault in self._stage.scene.faults:
            if isinstance(fault, PortPlugged) and (fault.unit, fault.port) == target:
                self._stage.plant.set_plug(fault.unit, fault.port, attempt in fault.attempts)

    def _record(self, last: Action, reason: str) -> AttemptRecord:
        estimate = self._robot.estimate
        return AttemptRecord(
            step=self._index,
            attempt=last.attempt,
            ended_s=seconds(last.stamp_ns),
            phase=last.phase,
            reason=reason,
            believed=PlanarPose.of(estimate.X_DU) if estimate else None,
            true=PlanarPose.of(self._judge.X_DU()),
        )

    def _end(self, action: Action, outcome: Outcome | None) -> StepResult:
        plant, unit = self._stage.plant, self._step.unit
        self._records.append(self._record(action, action.reason))
        seating = self._judge.seating()
        closed = plant.lock_position(unit) is LockPosition.CLOSED
        engaged = plant.lock_engaged(unit)
        passed = None
        if outcome is None:
            plant.command(unit, Twist())
            if action.phase is Phase.DONE:
                passed = engaged and plant.pull_test(unit).holds
                outcome = self._judge.verdict_docked(seating, engaged, passed)
            else:
                outcome = self._judge.verdict_gave_up(
                    self._robot.belief.setback, self._hardware.ever_detected
                )
        self._narrator.verdict(plant.now_ns(), outcome)
        return StepResult(
            outcome=outcome,
            belief=self._robot.belief,
            action=action,
            contact=self._judge.contact,
            seating=seating,
            lock_closed=closed,
            lock_engaged=engaged,
            pull_test_passed=passed,
            min_clearance_m=self._judge.min_clearance,
            assembly=self._figures(),
            records=tuple(self._records),
        )
