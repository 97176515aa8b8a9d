"""The mission of units that a base station leads: messages over the radio, steps as routes begin."""

from __future__ import annotations

from collections.abc import Mapping

from msrr_bullet.base_station.base_station import BaseStation
from msrr_bullet.log import topics
from msrr_bullet.log.records import Level, StepStart
from msrr_bullet.profiler import Profiler
from msrr_bullet.replay.recorded_base_station import RecordedBaseStation
from msrr_bullet.replay.recorded_robot import RecordedLedRobot
from msrr_bullet.robot.fail_safe import led_robot
from msrr_bullet.sensors.schedule import Periodic, duration_ns
from msrr_bullet.sensors.sensor_suite import MountedCamera
from msrr_bullet.trial.arena_judge import Safety
from msrr_bullet.trial.docking_step import STOP_TIME_S, DockingStep
from msrr_bullet.trial.environment import Environment
from msrr_bullet.trial.mission import MissionLoop
from msrr_bullet.trial.mission_figures import MissionRecord
from msrr_bullet.trial.result import MissionFigures
from msrr_bullet.trial.telemetry import Telemetry
from msrr_bullet.trial.unit_runner import UnitRunner
from msrr_bullet.trial.verdict import Verdict, time_is_up
from msrr_control.coordination.ledger import SAME_M
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, Detections, GlobalPose
from msrr_scenes.messages.coordination import MissionState, MissionStatus, UnitState
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.mission import RadioSpec

#: Steps of the base station per second [Hz].
_BASE_RATE_HZ = 10.0


class _Member:
    """A unit of the mission: its robot, what lets it act, and its present step."""

    def __init__(self, environment: Environment, unit: str, telemetry: Telemetry, profiler: Profiler) -> None:
        simulation = environment.simulation
        self.robot = led_robot(simulation.scene.told(), unit, profiler)
        recorded = RecordedLedRobot(self.robot, unit, telemetry.recorder, simulation.plant.now_ns)
        self.recorded = recorded if telemetry.is_heard else self.robot
        self.runner = UnitRunner(environment, unit, self.recorded, profiler)
        self.step: DockingStep | None = None
        self.begun: tuple[int, bool] = (0, False)  # route and whether it was leaving a port
        self.waits = False  # on standby, which only an authority can end
        self._failed_ns: int | None = None

    def has_come_to_rest(self, now_ns: int) -> bool:
        """Return whether the program of the robot has failed, long enough ago for the unit to stand."""
        if self.robot.failure is None:
            return False
        self._failed_ns = now_ns if self._failed_ns is None else self._failed_ns
        return now_ns - self._failed_ns > duration_ns(STOP_TIME_S)


class CoordinatedMission(MissionLoop):
    """Carries out the mission of a base station.

    All robots last for the whole mission. A step begins when a robot begins a route that leads into a port or
    out of one.
    """

    def __init__(self, environment: Environment, telemetry: Telemetry, profiler: Profiler) -> None:
        """Begin the mission of the environment's scene."""
        super().__init__(environment, telemetry, profiler)
        scene, plant, devices = self._scene, self._plant, environment.devices
        assert devices.radio is not None, "a scene with a base station has a radio"
        self._radio = devices.radio
        self._base = RecordedBaseStation(
            BaseStation(scene.told(), profiler), telemetry.recorder, plant.now_ns
        )
        self._camera = MountedCamera(devices.overhead(profiler), plant.now_ns())
        self._members = {u: _Member(environment, u, telemetry, profiler) for u in scene.units}
        self._base_timer = Periodic(_BASE_RATE_HZ, plant.now_ns())
        rate_hz = (scene.radio or RadioSpec()).rate_hz
        # The units share the radio: each has its own time in the period.
        share_ns = round(NS_PER_S / rate_hz / len(scene.units))
        self._reports = {u: Periodic(rate_hz, k * share_ns) for k, u in enumerate(scene.units)}
        self.record = MissionRecord(tuple(scene.units))

    def _next_ns(self) -> float:
        moving = (m.runner.next_ns for m in self._members.values() if not m.waits and m.runner.running)
        reports = (timer.next_ns for timer in self._reports.values())
        return min(self._camera.next_ns, self._radio.next_ns, self._base_timer.next_ns, *reports, *moving)

    def _sense(self, now_ns: int) -> None:
        try:
            self._run_base(now_ns)
        except ProgramFailedError as error:
            self._telemetry.event(now_ns, "base_station", str(error), Level.ERROR)
            self._end(Verdict(Outcome.PROGRAM_FAILED, str(error)))
            return
        arrived = self._radio.arrived_at_units(now_ns)
        for unit, member in self._members.items():
            for authority in arrived.get(unit, ()):
                member.recorded.authorise(authority)
                member.waits = False
            if self._reports[unit].due(now_ns):
                self._radio.from_units[unit].send(member.recorded.report(now_ns), now_ns)
            if not member.waits and member.runner.running:
                member.runner.sense(now_ns)

    def _run_base(self, now_ns: int) -> None:
        """Let the base station see, hear, decide and speak."""
        for message in self._camera.tick(now_ns, self._base):
            assert isinstance(message, (Detections, GlobalPose))
            with self._profiler("perception"):
                seen_poses = self._base.see(message)
                for member in self._members.values():
                    member.robot.see(seen_poses)
        for report in self._radio.arrived_at_base(now_ns):
            self._base.hear(report)
        if self._base_timer.due(now_ns):
            for authority in self._base.step(now_ns):
                self._radio.to_units[authority.unit].send(authority, now_ns)

    def _decide(self, now_ns: int) -> None:
        if self._over:
            return
        for member in self._members.values():
            if member.waits:
                continue
            if member.robot.active and not member.has_come_to_rest(now_ns):
                self._decide_for(member, now_ns)
            elif not member.runner.running:
                member.waits = True
            elif member.step is None:
                member.runner.stop()
        ended = self._judge(now_ns)
        if ended is None:
            return
        for step in ended:
            member = self._members[step.step.unit]
            member.step = None
            self.record.ended(now_ns, step)
        status = self._base.program.status
        if now_ns >= self._deadline_ns:
            self._end(time_is_up(self._scene.time_limit_s, _still_to_do(status)))
        elif status.state is not MissionState.RUNNING and not self._anybody_moves():
            complete = status.state is MissionState.COMPLETE
            self._end(Verdict(Outcome.COMPLETE if complete else Outcome.INCOMPLETE, status.reason))

    def _anybody_moves(self) -> bool:
        return any(member.runner.running for member in self._members.values())

    def _decide_for(self, member: _Member, now_ns: int) -> None:
        """Let a robot decide, and begin the step that begins with its decision."""
        runner, robot = member.runner, member.robot
        if not runner.running:
            runner.start(None, [])
        last = runner.decide(now_ns)
        if member.begun != (robot.route, robot.leaving):
            if member.step is not None:
                member.step.end(Verdict(Outcome.ABORTED))
                self._retire(member.step, now_ns)
            member.begun = (robot.route, robot.leaving)
            self._begin_step(member)
            last = runner.action
        if member.step is not None:
            member.step.follow(last)

    def _begin_step(self, member: _Member) -> None:
        """Begin the step of a route; a route into the open has none."""
        environment, runner, robot = self._environment, member.runner, member.robot
        member.step, dock = None, robot.dock_step
        if dock is None:
            now_ns = self._plant.now_ns()
            self._telemetry.recorder.write(topics.STEPS, now_ns, StepStart(now_ns, -1, runner.unit))
            runner.start(None, [])
            return
        if robot.leaving:
            environment.locked.remove(dock.unit)
        step = DockingStep(
            environment,
            len(self._begun),
            dock,
            robot,
            runner,
            self._telemetry.recorder,
            undocks=robot.leaving,
        )
        runner.start(dock, [environment.devices.onboard(dock, step.judge.X_DU, self._profiler)])
        member.step = step
        self._begun.append(step)
        self._active.append(step)

    def _actuate(self, now_ns: int) -> None:
        for member in self._members.values():
            if not member.waits and member.runner.running:
                member.runner.actuate(now_ns)

    def _clearance_that_matters(self) -> float:
        return max(super()._clearance_that_matters(), self.record.min_clearance)

    def _note(self, now_ns: int, poses: Mapping[str, SE2], safety: Safety) -> None:
        super()._note(now_ns, poses, safety)
        self.record.note(now_ns, poses, safety.nearest)

    def figures(self) -> MissionFigures:
        """Return the figures of a mission that has ended."""
        return self.record.figures(self._base.program.status, self._radio.sent, self._radio.lost)


def _still_to_do(status: MissionStatus) -> str:
    """Return in words who waits for whom, is under way or out of action, as far as the base station knows."""
    waits, drives, out = [], [], []
    for unit in status.units:
        if unit.blocked_by is not None and unit.progress >= unit.limit - SAME_M:
            waits.append(f"{unit.unit} waits for {unit.blocked_by}")
        elif unit.state is UnitState.UNDER_WAY:
            drives.append(unit.unit)
        elif unit.state in (UnitState.LOST, UnitState.FAILED):
            out.append(f"{unit.unit} ({unit.reason})")
    lists = [
        f"{what}: {', '.join(who)}" for what, who in (("under way", drives), ("out of action", out)) if who
    ]
    return "; ".join([*waits, *lists]) or status.reason
