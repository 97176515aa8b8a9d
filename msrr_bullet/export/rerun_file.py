"""A log as a recording of Rerun, with what Rerun does not read of it by itself, and a layout of views.

Rerun reads images, calibrations, transforms, poses and log lines of a log. Shapes of bodies, paths,
detections and curves are added here.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from msrr_bullet.log import Log
from msrr_bullet.log.frame_tree import WORLD
from msrr_bullet.log.topics import image, unit_of
from msrr_bullet.timeline.palette import DETECTION, OBSTACLE, PATH, unit_colours
from msrr_scenes.camera_lenses import camera_lenses
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.solid import Solid
from msrr_scenes.messages import (
    OVERHEAD,
    AssemblyPath,
    Detections,
    Exposure,
    Localisation,
    PoseEstimate,
    TagDetection,
    onboard_camera,
)
from msrr_scenes.specs.scene import Scene
from msrr_scenes.whole_files import whole_file

if TYPE_CHECKING:
    import rerun as rr

#: Name that Rerun gives to the time at which a message of a log was written.
_TIMELINE = "message_log_time"

#: What the last bytes of a recording begin with.
_FOOTER, _FOOTER_SIZE = b"RRF2FOOT", 12


def write_rerun(log: Log, path: Path) -> None:
    """Write a log as a file that Rerun opens, all of it or nothing.

    The URDFs of the log have to be unpacked (:func:`msrr_bullet.log.unpacked_log`). The name of the file ends
    in ``.rrd``; an older one is lost only when the new one is whole.

    Raises:
        MsrrError: The name does not end in ``.rrd``, the package rerun-sdk is not installed, the log ends
            early, or the file cannot be written.
    """
    if path.suffix != ".rrd":
        raise MsrrError(f"{path}: the name of a recording of Rerun ends in .rrd")
    try:
        import rerun  # noqa: F401 - is it there?
    except ImportError:
        raise MsrrError("the package rerun-sdk is not installed; pip install 'msrr-bullet[rerun]'") from None
    if not log.complete:
        raise MsrrError(
            f"{log.path}: the log ends early, and Rerun reads only whole ones; export it with --csv"
        )
    try:
        with whole_file(path, ".rrd") as part:
            part.write_bytes(b"")  # Rerun's own error is an error of its program
            _write(log, part)
            # A thread of Rerun writes the file, and does not report that it cannot; the footer comes last.
            if not part.read_bytes()[-_FOOTER_SIZE:].startswith(_FOOTER):
                raise MsrrError(f"{path}: cannot be written to its end; is the disk full?")
    except OSError as error:
        raise MsrrError(f"{path}: cannot be written ({error.strerror})") from None
    except RuntimeError as error:
        raise MsrrError(f"{path}: Rerun cannot write it: {error}") from None


def _write(log: Log, path: Path) -> None:
    import rerun as rr

    topics = (
        *("/control/*/path", "/camera/*/exposure", "/perception/*/detections", "/perception/*/estimate"),
        "/sensors/*/localisation",
    )
    # Rerun ends the process on some damaged logs, so all of the log is read, and judged, before it.
    messages = [(r.stamp_ns, unit_of(r.topic), r.message) for r in log.records(*topics)]
    scene = log.header.scene
    # Rerun takes recordings with one name for parts of one, also two runs of a trial with other controllers.
    digest = hashlib.blake2b(log.path.read_bytes(), digest_size=6).hexdigest()
    recording = rr.RecordingStream("msrr-bullet", recording_id=f"{scene.name}-{log.header.seed}-{digest}")
    recording.save(path, default_blueprint=_layout(scene))
    recording.log_file_from_path(log.path)
    _log_bodies(recording, scene)
    lenses = camera_lenses(scene)
    for stamp_ns, unit, message in messages:
        recording.set_time(_TIMELINE, timestamp=np.datetime64(stamp_ns, "ns"))
        _log_message(recording, lenses, unit, message)
    recording.disconnect()


def _log_bodies(recording: rr.RecordingStream, scene: Scene) -> None:
    """Log the shapes of bodies, each in the frame that Rerun knows by the transforms of the log."""
    for unit, colour in unit_colours(scene).items():
        _log_solids(recording, unit, list(scene.geometry(unit).solids), colour)
    for name, spec in scene.obstacles.items():
        _log_solids(recording, name, [spec.solid], OBSTACLE)


def _log_solids(recording: rr.RecordingStream, body: str, solids: list[Solid], rgb: int) -> None:
    import rerun as rr

    centres, halves, turns = [], [], []
    for solid in solids:
        if solid.kind == "box":
            centre, half, turn = solid.X_UG.p, 0.5 * np.array(solid.size), solid.X_UG.quaternion_xyzw()
        else:  # the box about it
            points = solid.points()
            low, high = points.min(axis=0), points.max(axis=0)
            centre, half, turn = 0.5 * (low + high), 0.5 * (high - low), np.array([0.0, 0.0, 0.0, 1.0])
        centres.append(centre)
        halves.append(half)
        turns.append(rr.Quaternion(xyzw=turn))
    boxes = rr.Boxes3D(
        centers=centres, half_sizes=halves, quaternions=turns, colors=[_rgb(rgb)], fill_mode="solid"
    )
    recording.log(f"bodies/{body}", rr.CoordinateFrame(body), boxes, static=True)


def _log_message(recording: rr.RecordingStream, lenses: Mapping[str, Lens], unit: str, message: Any) -> None:
    import rerun as rr

    if isinstance(message, AssemblyPath):
        points = [(x, y, 0.003) for x, y in message.points]
        line = rr.LineStrips3D([points], colors=[_rgb(PATH)])
        recording.log(f"paths/{unit}", rr.CoordinateFrame(WORLD), line)
    elif isinstance(message, Exposure):
        # The time of the image, and of its tags, is that by the clock of the camera.
        recording.set_time(_TIMELINE, timestamp=np.datetime64(message.stamp_ns, "ns"))
        _log_tags(recording, lenses, message, ())  # those of the frame before belong to that alone
    elif isinstance(message, Localisation):
        _log_message(recording, lenses, unit, message.detections)
    elif isinstance(message, Detections):
        stamp = np.datetime64(message.exposure.stamp_ns, "ns")
        recording.set_time(_TIMELINE, timestamp=stamp)  # that of the image
        _log_tags(recording, lenses, message.exposure, message.tags)
    elif isinstance(message, PoseEstimate):
        X, P = message.X_DU, message.covariance
        for name, value, variance in (("x", X.x, P[0, 0]), ("y", X.y, P[1, 1])):
            recording.log(f"curves/{unit}/{name}_mm", rr.Scalars(1e3 * value))
            recording.log(f"curves/{unit}/{name}_sigma_mm", rr.Scalars(1e3 * math.sqrt(max(variance, 0.0))))
        recording.log(f"curves/{unit}/yaw_deg", rr.Scalars(math.degrees(X.yaw)))


def _log_tags(
    recording: rr.RecordingStream,
    lenses: Mapping[str, Lens],
    exposure: Exposure,
    tags: Sequence[TagDetection],
) -> None:
    import rerun as rr

    lens = lenses[exposure.camera]  # the image is that of the lens, and corners are those of the ideal image
    outlines = [lens.distorted(np.vstack([tag.corners, tag.corners[:1]])) for tag in tags]
    labels = [str(tag.tag_id) for tag in tags]
    # Rerun names the plane of an image after the frame of its camera.
    plane = rr.CoordinateFrame(f"{exposure.camera}_image_plane")
    lines = rr.LineStrips2D(outlines, labels=labels, colors=[_rgb(DETECTION)])
    recording.log(f"{image(exposure.camera).removeprefix('/')}/tags", plane, lines)


def _layout(scene: Scene) -> Any:
    """Return the views: the world, both cameras of the first unit that docks, curves and events."""
    import rerun.blueprint as rrb

    unit = next((step.unit for step in scene.docks), next(iter(scene.units)))
    world = rrb.Spatial3DView(
        origin="/",
        name="World",
        contents=["/tf", "/bodies/**", "/paths/**"],
        spatial_information=rrb.SpatialInformation(target_frame=WORLD),
    )
    cameras = [onboard_camera(unit), *([OVERHEAD] if scene.cameras.overhead else [])]
    images = [rrb.Spatial2DView(origin=image(camera), name=camera) for camera in cameras]
    curves = rrb.TimeSeriesView(origin="/curves", name="Estimates [mm, deg]")
    events = rrb.TextLogView(origin="/log", name="Events")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(world, events, row_shares=[3, 1]),
            rrb.Vertical(*images, curves),
        ),
        rrb.TimePanel(timeline=_TIMELINE, state="collapsed", play_state="playing"),
        collapse_panels=True,
    )


def _rgb(colour: int) -> list[int]:
    return [colour >> 16 & 255, colour >> 8 & 255, colour & 255]
