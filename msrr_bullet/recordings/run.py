"""Perception on a recording, with a run folder as a trial has one: log, figures, page and picture."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from msrr_bullet.figures.frames.stills import draw_stills
from msrr_bullet.figures.plots.summary import write_picture
from msrr_bullet.log import topics
from msrr_bullet.log.frame_tree import WORLD
from msrr_bullet.log.header import LogHeader
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.reader import LOG_NAME, unpacked_log
from msrr_bullet.log.recorder import NullRecorder, Recorder
from msrr_bullet.log.records import Event, FrameLink, FrameLinks, Level, StartPoses, StepStart
from msrr_bullet.recordings.opening import open_recording
from msrr_bullet.recordings.perceiver import PerceivedInstant, Perceiver, random_walk
from msrr_bullet.recordings.recording import RecordedFrame, Recording, RecordingError, frame_period_s
from msrr_bullet.recordings.result import RecordingResult, Tally
from msrr_bullet.recordings.wheels import WheelReader
from msrr_bullet.run_folder import (
    PICTURE_NAME,
    REPLAY_NAME,
    RESULT_NAME,
    RUN_FILES,
    RunFolderError,
    check_folder,
    delete_run,
    locked,
    make_folder,
)
from msrr_bullet.timeline.camera_views import docking_views
from msrr_bullet.timeline.log_snapshots import read_events, read_snapshots
from msrr_bullet.trial.versions import trial_versions
from msrr_bullet.viewer.replay_page import write_replay
from msrr_perception.motion.motion_noise import MotionNoise
from msrr_perception.photographs.picture_files import FILMS, PICTURES, PictureError
from msrr_scenes.errors import ChangedFileError, MsrrError, ProgramFailedError, SceneError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.loading.load import placed
from msrr_scenes.loading.target_file import read_target, target_scene
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CalibrationSpec
from msrr_scenes.specs.target import ROBOT, TARGET, RobotSpec, TargetSpec
from msrr_scenes.whole_files import write_whole


@dataclass(frozen=True, slots=True)
class Options:
    """What the user says beside the recording and the target.

    Attributes:
        calibration: Calibration of the camera; None takes that of the target, or else of the recording.
        rate_hz: Rate of pictures without times [Hz]; None takes that of the camera of the target.
        topic: Topic of the images in an MCAP file; None if there is no choice.
        odometry: Topic of the odometry, or ``none`` to leave it out; None if there is no choice.
    """

    calibration: CalibrationSpec | None = None
    rate_hz: float | None = None
    topic: str | None = None
    odometry: str | None = None


def perceive(
    path: Path,
    target: Path,
    options: Options | None = None,
    *,
    out: Path | None = None,
    report: Callable[[str], None] | None = None,
    observer: Callable[[PerceivedInstant], None] | None = None,
) -> RecordingResult:
    """Run the perception of a robot over a recording.

    Args:
        path: MCAP file, run folder of a trial, film, picture, or folder of pictures.
        target: Target file.
        options: What else is to be said.
        out: Run folder for the log, the result, the page and the picture; None writes nothing.
        report: Called with one message for every picture that cannot be used, and where reading ends early,
            as ``cut_off`` of the result tells.
        observer: Called with what is known at every instant.

    Raises:
        MsrrError: The target or the recording cannot be used at all, or the folder cannot be written.
    """
    options = options or Options()
    spec = read_target(target)
    if out is not None and _would_delete(out, path):
        raise RunFolderError(f"{out}: the recording is read from there; choose another --out")
    recording = _opened(path, spec, target, options)
    if options.rate_hz is not None and recording.has_times:
        raise RecordingError(f"{path}: --rate is for pictures; this recording has times of its own")
    calibration = options.calibration
    told = calibration is not None or {"calibration", "hfov_deg"} & spec.camera.model_fields_set
    if recording.calibration is not None and not told:
        calibration = recording.calibration()
        if recording.calibrated_by:
            by = f"{recording.source}, calibration on {recording.calibrated_by}"
            recording = replace(recording, source=by)
    with tempfile.TemporaryDirectory(prefix="msrr-perceive-") as folder, ExitStack() as lock:
        scene = target_scene(spec, target, Path(folder), calibration)
        if options.rate_hz is not None:
            onboard = scene.cameras.onboard.model_copy(update={"rate_hz": options.rate_hz})
            scene = scene.with_camera("onboard", onboard)
        _refuse_unusable(scene, recording)  # before a run that is in the folder gives way to the new one
        if out is None:
            return _run(scene, spec, recording, NullRecorder(), report, observer)
        with _recorder(out, scene, recording, lock) as recorder:
            result = _run(scene, spec, recording, recorder, report, observer)
        _write_derived_files(out, result)
    return result


def _refuse_unusable(scene: Scene, recording: Recording) -> None:
    """Refuse a target of which the perception cannot be built, and a recording without a usable picture."""
    try:
        perceiver = Perceiver(scene, NullRecorder(), report=lambda _: None)
    except (ProgramFailedError, ChangedFileError):
        raise
    except MsrrError as error:
        raise SceneError(placed(scene, str(error))) from error
    first: PictureError | None = None
    for frame in recording.items():
        if isinstance(frame, RecordedFrame):
            try:
                perceiver.read(frame)
            except PictureError as error:
                first = first or error
            else:
                return
    if first is not None:
        raise RecordingError(f"no picture can be used; the first one: {first}")


def _would_delete(out: Path, path: Path) -> bool:
    """Return whether a new run in a folder would replace the recording that it is made of, or add to it."""
    source = path.resolve()
    inside = source.name in RUN_FILES or source.suffix.lower() in (*PICTURES, *FILMS, ".mcap")
    return out.resolve() == (source.parent if inside else source)


def _opened(path: Path, spec: TargetSpec, target: Path, options: Options) -> Recording:
    robot = read_unit(find_urdf(spec.robot.urdf, target.parent))
    joints = None
    if spec.robot.wheel_joints is not None:  # a driver may have other names for them than the URDF
        left, right = spec.robot.wheel_joints
        drawn_left, drawn_right = robot.wheel_joints
        joints = replace(drawn_left, name=left), replace(drawn_right, name=right)

    def wheels() -> WheelReader:
        return WheelReader(robot.wheel_radius, robot.track, joints)

    rate_hz = options.rate_hz or spec.camera.rate_hz
    # A film does not say when its frames arrived; estimates that are made later may use them at once.
    latency_ns = round(1e6 * spec.camera.latency_ms) if "latency_ms" in spec.camera.model_fields_set else 0
    return open_recording(
        path,
        wheels,
        topic=options.topic,
        odometry=options.odometry,
        rate_hz=rate_hz,
        latency_ns=latency_ns,
    )


#: What is taken for granted of a target file that tells of no tolerance.
_PERFECT = (
    "no tolerances: robot, camera and target are taken to be exactly as the target file has them, which no "
    "real ones are; as_built: careful has the tolerances of careful builders"
)


def assumption(robot: RobotSpec, period_s: float) -> str:
    """Return what is taken for granted of the motion where there is no odometry."""
    return (
        f"no odometry: between frames, at {1.0 / period_s:.3g} Hz, the robot is taken to move at random by "
        f"about {1e3 * robot.speed_mps * period_s:.0f} mm in every direction, at {robot.speed_mps:g} m/s and "
        f"{robot.turn_rate_radps:g} rad/s"
    )


def _run(
    scene: Scene,
    spec: TargetSpec,
    recording: Recording,
    recorder: Recorder,
    report: Callable[[str], None] | None,
    observer: Callable[[PerceivedInstant], None] | None,
) -> RecordingResult:
    now_ns = 0
    tags = frozenset(scene.tag_ids(TARGET).values())
    tally = Tally(scene, tags)

    def complain(text: str) -> None:
        recorder.write(topics.EVENTS, now_ns, Event(now_ns, "recording", text, Level.WARNING))
        if report is not None:
            report(text)

    def unusable(text: str) -> None:
        tally.unusable += 1
        complain(text)

    motion: MotionNoise | None = None
    assumed: tuple[str, ...] = ()
    if not recording.has_odometry:
        period_s = frame_period_s(recording) or 1.0 / scene.cameras.onboard.rate_hz
        motion, text = random_walk(spec.robot, period_s), assumption(spec.robot, period_s)
        assumed = (f"{text}; {recording.unread}" if recording.unread else text,)
    if str(spec.as_built) == "perfect":
        assumed = (*assumed, _PERFECT)
    perceiver = Perceiver(scene, recorder, unusable, motion)
    try:
        for instant in perceiver.run(recording.items()):
            now_ns = instant.stamp_ns
            tally.add(instant)
            if observer is not None:
                observer(instant)
    except (RecordingError, ProgramFailedError) as error:  # what came before is worth having
        tally.cut_off = True
        complain(str(error))
    result = tally.result(
        recording.source,
        recording.start_ns,
        recording.has_odometry,
        assumed,
        perceiver.calibration_errors(),
        perceiver.without_wheels,
    )
    for text in result.warnings():
        recorder.write(topics.EVENTS, now_ns, Event(now_ns, "recording", text, Level.WARNING))
    return result


@contextmanager
def _recorder(out: Path, scene: Scene, recording: Recording, lock: ExitStack) -> Iterator[Recorder]:
    """Open the log of a run folder, which is kept for this run until ``lock`` is closed, and begin it."""
    check_folder(out)
    header = LogHeader.of(scene, 0, trial_versions(), recording.source)
    make_folder(out)
    lock.enter_context(locked(out))
    delete_run(out)
    with McapRecorder(out / LOG_NAME, header) as recorder:
        step = scene.docks[0]
        X_WU = scene.units[TARGET].pose.nominal
        recorder.write(topics.STARTS, 0, StartPoses(0, {TARGET: X_WU}))
        recorder.write(topics.FRAMES, 0, FrameLinks(0, (FrameLink(WORLD, TARGET, SE3.from_se2(X_WU)),)))
        recorder.write(topics.STEPS, 0, StepStart(0, 0, ROBOT, step.port, step.to))
        yield recorder


def _write_derived_files(out: Path, result: RecordingResult) -> None:
    """Write what follows from the log; the result comes first, in case a later file cannot be written."""
    try:
        write_whole(out / RESULT_NAME, result.to_json())
        with unpacked_log(out) as log:
            snapshots = read_snapshots(log)
            if not snapshots:
                return
            views, scene = docking_views(log), log.header.scene
            stills = draw_stills(log, snapshots)
            write_replay(out / REPLAY_NAME, scene, snapshots, stills, read_events(log))
            write_picture(out / PICTURE_NAME, scene, snapshots, views, log.header.origin)
    except OSError as error:
        raise RunFolderError(f"{error.filename or out}: cannot be written ({error.strerror})") from None
