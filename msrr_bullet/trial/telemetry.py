"""The outputs of a running trial: truth and events for the log, snapshots for a viewer, progress."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.log import topics
from msrr_bullet.log.recorder import NullRecorder, Recorder
from msrr_bullet.log.records import JUDGE, BuiltErrors, ClearanceRecord, Event, Level, StartPoses, TruePose
from msrr_bullet.simulation.simulation import Simulation
from msrr_bullet.timeline.camera_views import CameraViewCollector, CameraViewer
from msrr_bullet.timeline.snapshot import Viewer
from msrr_bullet.timeline.snapshot_builder import SnapshotBuilder
from msrr_bullet.trial.docking_step import DockingStep
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Action, Exposure, Phase, Pixels, seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


@dataclass(frozen=True, slots=True)
class Progress:
    """The state of a running trial at one control instant, for progress displays.

    Attributes:
        time_s: Simulated time [s].
        phase: Phase of the robot.
        attempt: Number of the attempt, from 1.
        step: The step.
        believed: Estimate X_DU; None without an estimate.
        true: True X_DU; None before the first step.
        reason: Reason for entering the phase.
    """

    time_s: float
    phase: Phase
    attempt: int
    step: DockStep
    believed: SE2 | None = None
    true: SE2 | None = None
    reason: str = ""


class Telemetry:
    """Writes the reports of a trial. Nothing of them reaches the robot.

    ``is_heard`` is whether the recorder keeps or shows anything of it.
    """

    def __init__(
        self,
        recorder: Recorder,
        scene: Scene,
        viewer: Viewer | None = None,
        observer: Callable[[Progress], None] | None = None,
    ) -> None:
        """Report on a trial of a scene to a recorder and, where given, to a viewer and to an observer."""
        self._units = scene.units
        self._live = None if viewer is None else _LiveSnapshots(recorder, scene, viewer)
        self.recorder: Recorder = self._live or recorder
        self.is_heard = not isinstance(self.recorder, NullRecorder)
        self._observer = observer
        self._last_actions: dict[int, Action] = {}  # by the index of the step

    def begin(self, simulation: Simulation) -> None:
        """Record the start poses of all bodies, and what is not as the scene says."""
        placement, errors = simulation.placement, simulation.built.errors
        poses = {**placement.units, **placement.obstacles}
        self.recorder.write(topics.STARTS, 0, StartPoses(placement.redraws, poses))
        if errors:
            self.recorder.write(topics.AS_BUILT, 0, BuiltErrors(dict(errors)))

    def report(
        self, now_ns: int, poses: Mapping[str, SE2], steps: Sequence[DockingStep], nearest: Clearance | None
    ) -> None:
        """Report one control instant, after the decisions of all robots.

        The poses of all bodies are the true ones at this instant, and ``nearest`` is the smallest true
        clearance of all pairs that may not touch; None without such a pair.
        """
        if self.is_heard:
            for unit in self._units:
                self.recorder.write(topics.true_pose(unit), now_ns, TruePose(unit, now_ns, poses[unit]))
            if nearest is not None:
                self.recorder.write(topics.CLEARANCE, now_ns, ClearanceRecord.of(now_ns, nearest))
        for step in steps:
            self._report_change(step)
            if self._observer is not None:
                self._observer(_progress(step))
        if self._live is not None:
            self._live.show()

    def _report_change(self, step: DockingStep) -> None:
        """Record an event if the phase or the attempt of a unit has changed."""
        action, last = step.action, self._last_actions.get(step.index)
        self._last_actions[step.index] = action
        if last is None or (last.phase, last.attempt) != (action.phase, action.attempt):
            text = f"attempt {action.attempt}: {action.phase.text}: {action.reason}"
            self.event(action.stamp_ns, step.step.unit, text)

    def verdict(self, stamp_ns: int, step: DockingStep) -> None:
        """Record the verdict on a step that has ended."""
        assert step.verdict is not None, "the step has ended"
        way = "from" if step.undocks else "to"
        outcome, said = step.verdict.outcome, step.verdict.reason
        text = f"{step.step.unit} {way} {step.step.to}: {outcome.value}{', ' if said else ''}{said}"
        self.event(stamp_ns, JUDGE, text, _level(outcome))

    def end(self, stamp_ns: int, outcome: Outcome) -> None:
        """Record the verdict on the trial."""
        self.event(stamp_ns, JUDGE, outcome.value, _level(outcome))

    def event(self, stamp_ns: int, source: str, text: str, level: Level = Level.INFO) -> None:
        """Record an event of ``source``, described by one line of text."""
        self.recorder.write(topics.EVENTS, stamp_ns, Event(stamp_ns, source, text, level))


class _LiveSnapshots:
    """Passes messages on to a recorder, and shows a viewer the snapshots that a log of them would give."""

    def __init__(self, recorder: Recorder, scene: Scene, viewer: Viewer) -> None:
        self._recorder, self._viewer, self._builder = recorder, viewer, SnapshotBuilder(scene)
        self._of_cameras = viewer if isinstance(viewer, CameraViewer) else None
        self._views = CameraViewCollector(scene)

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Record a message."""
        self._builder.add(topic, stamp_ns, message)
        self._recorder.write(topic, stamp_ns, message)
        view = self._views.add(message)
        if self._of_cameras is not None and view is not None and self._of_cameras.wants(view.exposure.camera):
            self._of_cameras.show_view(view)

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Record the pixels of a window."""
        self._recorder.window(exposure, window, pixels)
        if self._of_cameras is not None and self._of_cameras.wants(exposure.camera):
            self._views.add_window(exposure, window, pixels)

    def close(self) -> None:
        """Finish the log."""
        self._recorder.close()

    def show(self) -> None:
        """Show the present instant."""
        snapshot = self._builder.finish()
        if snapshot is not None:
            self._viewer.update(snapshot)


def _level(outcome: Outcome) -> Level:
    good = (Outcome.DOCKED, Outcome.UNDOCKED, Outcome.COMPLETE)
    return Level.INFO if outcome in good else Level.WARNING


def _progress(step: DockingStep) -> Progress:
    action = step.action
    return Progress(
        seconds(action.stamp_ns),
        action.phase,
        action.attempt,
        step.step,
        step.believed(action.phase),
        step.judge.X_DU(),
        action.reason,
    )
