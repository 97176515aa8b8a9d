"""One trial: the loop in which physics, sensors, robot, judge and log meet."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from msrr_bullet.autonomy import Autonomy
from msrr_bullet.bullet_plant import BulletPlant
from msrr_bullet.clearance import Clearance, ClearanceModel
from msrr_bullet.hardware import Eye, Hardware, ImageEye, ParametricEye
from msrr_bullet.judge import Judge
from msrr_bullet.link import CommandLink
from msrr_bullet.log import topics
from msrr_bullet.log.recorder import NullRecorder, Recorder
from msrr_bullet.log.records import Clearance as ClearanceRecord
from msrr_bullet.log.records import Event, Level, StartPoses, TruePose
from msrr_bullet.log.tap import RecordedRobot
from msrr_bullet.odometry import WheelEncoders
from msrr_bullet.plant import Plant
from msrr_bullet.progress import Progress
from msrr_bullet.render.renderer import RenderContext, build_renderer
from msrr_bullet.result import AttemptRecord, Belief, PlanarPose, TrialResult
from msrr_bullet.schedule import Periodic
from msrr_bullet.stage_clock import Clock, NullClock
from msrr_bullet.streams import stream
from msrr_bullet.tag_dressing import TagDressing
from msrr_bullet.unicycle_plant import UnicyclePlant
from msrr_bullet.viewer.snapshot import Snapshot, Viewer
from msrr_bullet.world import BulletWorld
from msrr_scenes.faults import PortPlugged
from msrr_scenes.load import scene_hash
from msrr_scenes.messages import Action, Conviction, Phase, Twist, seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.placement import Placement, draw_placement
from msrr_scenes.plan import DockStep
from msrr_scenes.scene import Scene
from msrr_scenes.se2 import SE2

#: How often truth goes to the log between control instants: not at all. It is written with every decision.
_OVER = frozenset({Phase.DONE, Phase.FAILED})

_BELIEFS: dict[Conviction, Belief] = {
    Conviction.DOCKED: "docked",
    Conviction.GAVE_UP: "gave_up",
}


@contextmanager
def open_plant(scene: Scene, placement: Placement) -> Iterator[tuple[Plant, BulletWorld | None]]:
    """Build the plant a scene asks for, and the world that its cameras see (None when nobody looks)."""
    with ExitStack() as stack:
        world = None
        if scene.plant == "bullet" or scene.perception == "images":
            dressing = None
            if scene.perception == "images":
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="msrr-"))
                dressing = TagDressing(scene, Path(folder))
            world = stack.enter_context(BulletWorld(scene, placement, dressing=dressing))
        if scene.plant == "bullet":
            assert world is not None
            yield BulletPlant(world), world
        else:
            yield UnicyclePlant(scene, placement, world), world


@dataclass
class _StepEnd:
    """How a step of the plan ended."""

    outcome: Outcome
    robot: Autonomy
    action: Action
    judge: Judge
    pull_passed: bool | None
    lock_closed: bool
    lock_engaged: bool


class Trial:
    """Runs one scene with one seed. Use :func:`msrr_bullet.run.run_trial` unless you want the parts."""

    def __init__(
        self,
        scene: Scene,
        seed: int,
        *,
        recorder: Recorder | None = None,
        viewer: Viewer | None = None,
        observer: Callable[[Progress], None] | None = None,
        clock: Clock | None = None,
    ) -> None:
        """Prepare a trial.

        Args:
            scene: What to run.
            seed: Together with the scene it determines every bit of the log.
            recorder: Gets every message.
            viewer: Is shown the trial while it runs.
            observer: Is told the progress at every control instant.
            clock: Is told which stage is running.
        """
        self.scene = scene
        self.seed = seed
        self._recorder = recorder or NullRecorder()
        self._viewer = viewer
        self._observer = observer
        self._clock = clock or NullClock()
        self._clearance = ClearanceModel(scene)
        self._records: list[AttemptRecord] = []

    def run(self) -> TrialResult:
        """Run the trial to its end and return the verdict."""
        placement = draw_placement(self.scene, lambda name: stream(self.seed, name))
        with open_plant(self.scene, placement) as (plant, world):
            self._obstacles = dict(placement.obstacles)
            self._recorder.write(
                topics.STARTS, 0, StartPoses(placement.redraws, {**placement.units, **placement.obstacles})
            )
            self._encoders = {
                unit: WheelEncoders(unit, self.scene.odometry, stream(self.seed, f"unit/{unit}/odometry"))
                for unit in self.scene.units
            }
            self._links = {
                unit: CommandLink(self.scene.link, stream(self.seed, f"unit/{unit}/link"))
                for unit in self.scene.units
            }
            self._plant, self._world = plant, world
            attempts, min_clearance = 0, None
            for index, step in enumerate(self.scene.plan):
                end = self._run_step(index, step)
                attempts += end.action.attempt
                if end.judge.min_clearance is not None:
                    min_clearance = min(min_clearance or end.judge.min_clearance, end.judge.min_clearance)
                if end.outcome is not Outcome.DOCKED:
                    break
            return self._result(end, attempts, min_clearance, placement.redraws)

    def _eye(self, step: DockStep, judge: Judge) -> Eye:
        if self.scene.perception == "parametric":
            return ParametricEye(self.scene, step, judge.X_DU, self.seed)
        assert self._world is not None
        spec = self.scene.cameras.onboard
        renderer = build_renderer(spec.renderer, RenderContext(self._world.client, spec.samples))
        return ImageEye(self.scene, step.unit, self._plant, renderer, self.seed, self._clock)

    def _run_step(self, index: int, step: DockStep) -> _StepEnd:
        scene, plant = self.scene, self._plant
        plant.begin_dock(step)
        self._plug(step, attempt=1)
        judge = Judge(scene, step, plant, self._clearance)
        robot = Autonomy(scene, step)
        tapped = RecordedRobot(robot, step.unit, self._recorder, index, plant.now_ns())
        hardware = Hardware(
            scene, step, plant, self._eye(step, judge), self._encoders[step.unit], self._clock
        )
        control = Periodic(scene.control.rate_hz, plant.now_ns())
        link = self._links[step.unit]
        action: Action | None = None
        outcome: Outcome | None = None
        while True:
            now_ns = plant.now_ns()
            hardware.tick(now_ns, tapped)
            if control.due(now_ns):
                before = action
                with self._clock("control"):
                    action = tapped.step(now_ns)
                link.send(action)
                outcome, nearest = self._watch(judge, action)
                self._tell(index, step, judge, robot, action, before, nearest)
                if before is not None and action.attempt != before.attempt:
                    self._plug(step, action.attempt)
            assert action is not None  # the first control instant is the first tick
            arrived = link.arrived(now_ns)
            if arrived is not None:
                plant.command(step.unit, arrived.twist)
                plant.set_lock(step.unit, arrived.lock)
            if outcome is None and now_ns >= scene.time_limit_s * 1e9:
                outcome = Outcome.TIMEOUT
            if outcome is not None or action.phase in _OVER:
                return self._end_step(index, step, judge, robot, action, hardware, outcome)
            with self._clock("physics"):
                plant.step()
            with self._clock("judge"):
                judge.tick(plant.now_ns(), action.attempt, robot.estimate)

    def _watch(self, judge: Judge, action: Action) -> tuple[Outcome | None, Clearance | None]:
        with self._clock("clearance"):
            outcome, nearest = judge.safety(self._poses(), action)
        if nearest is not None:
            record = ClearanceRecord(
                action.stamp_ns,
                (nearest.body_a, nearest.body_b),
                nearest.distance,
                np.array([nearest.point_a, nearest.point_b]),
                exempt=nearest.distance <= 0.0 and outcome is None,
            )
            self._recorder.write(topics.CLEARANCE, action.stamp_ns, record)
        return outcome, nearest

    def _poses(self) -> dict[str, SE2]:
        now_s = seconds(self._plant.now_ns())
        poses = {unit: self._plant.pose(unit) for unit in self.scene.units}
        for name, X_WB in self._obstacles.items():
            if self.scene.obstacles[name].appears_at_s <= now_s:
                poses[name] = X_WB
        return poses

    def _tell(
        self,
        index: int,
        step: DockStep,
        judge: Judge,
        robot: Autonomy,
        action: Action,
        before: Action | None,
        nearest: Clearance | None,
    ) -> None:
        """Write truth to the log and show the instant to whoever watches."""
        poses = self._poses()
        for unit in self.scene.units:
            self._recorder.write(
                topics.true_pose(unit), action.stamp_ns, TruePose(unit, action.stamp_ns, poses[unit])
            )
        if before is None or action.phase is not before.phase or action.attempt != before.attempt:
            text = f"attempt {action.attempt}: {action.phase.value}: {action.reason}"
            self._recorder.write(topics.EVENTS, action.stamp_ns, Event(action.stamp_ns, step.unit, text))
        if before is not None and action.attempt != before.attempt:
            self._records.append(self._attempt(index, judge, robot, before))
        believed = robot.estimate.X_DU if robot.estimate else None
        if self._observer is not None:
            self._observer(
                Progress(
                    seconds(action.stamp_ns),
                    action.phase,
                    action.attempt,
                    index,
                    believed,
                    judge.X_DU(),
                    action.reason,
                )
            )
        if self._viewer is not None:
            X_WD = judge.X_WD()
            self._viewer.update(
                Snapshot(
                    action.stamp_ns,
                    {unit: poses[unit] for unit in self.scene.units},
                    {name: X for name, X in poses.items() if name in self._obstacles},
                    step,
                    X_WD @ believed if believed else None,
                    action.phase,
                    action.attempt,
                    robot.los,
                    nearest,
                )
            )

    def _attempt(self, index: int, judge: Judge, robot: Autonomy, action: Action) -> AttemptRecord:
        return AttemptRecord(
            step=index,
            attempt=action.attempt,
            ended_s=seconds(action.stamp_ns),
            phase=action.phase,
            reason=action.reason,
            believed=PlanarPose.of(robot.estimate.X_DU) if robot.estimate else None,
            true=PlanarPose.of(judge.X_DU()),
        )

    def _plug(self, step: DockStep, attempt: int) -> None:
        """Put the fault ``port_plugged`` into force for this attempt, or out of it."""
        for fault in self.scene.faults:
            if isinstance(fault, PortPlugged) and (fault.unit, fault.port) == (
                step.target_unit,
                step.target_port,
            ):
                self._plant.set_plug(fault.unit, fault.port, attempt in fault.attempts)

    def _end_step(
        self,
        index: int,
        step: DockStep,
        judge: Judge,
        robot: Autonomy,
        action: Action,
        hardware: Hardware,
        outcome: Outcome | None,
    ) -> _StepEnd:
        plant = self._plant
        self._records.append(self._attempt(index, judge, robot, action))
        self._seating = judge.seating()
        closed = plant.lock_position(step.unit).value == "closed"
        engaged = plant.lock_engaged(step.unit)
        plant.command(step.unit, Twist())
        passed = None
        if outcome is None and action.phase is Phase.DONE:
            passed = plant.pull_test(step.unit).holds if engaged else False
            outcome = judge.verdict_docked(self._seating, engaged, passed)
        elif outcome is None:
            outcome = judge.verdict_gave_up(hardware.ever_detected)
        level = Level.INFO if outcome is Outcome.DOCKED else Level.WARNING
        self._recorder.write(
            topics.EVENTS, action.stamp_ns, Event(action.stamp_ns, "judge", outcome.value, level)
        )
        return _StepEnd(outcome, robot, action, judge, passed, closed, engaged)

    def _result(self, end: _StepEnd, attempts: int, min_clearance: float | None, redraws: int) -> TrialResult:
        belief = end.robot.belief
        return TrialResult(
            scene=self.scene.name,
            scene_hash=scene_hash(self.scene),
            seed=self.seed,
            plant=self.scene.plant,
            perception=self.scene.perception,
            outcome=end.outcome,
            belief=_BELIEFS.get(belief.conviction, "undecided"),
            belief_reason=belief.reason or end.action.reason,
            attempts=attempts,
            duration_s=seconds(end.action.stamp_ns),
            phase=end.action.phase,
            contact=end.judge.contact,
            seating=self._seating,
            lock_closed=end.lock_closed,
            lock_engaged=end.lock_engaged,
            pull_test_passed=end.pull_passed,
            min_clearance_m=min_clearance,
            start_redraws=redraws,
            records=tuple(self._records),
        )
