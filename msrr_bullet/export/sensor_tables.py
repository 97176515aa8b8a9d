"""Tables of truth, of what the sensors measured, and of events; the reference describes them."""

from __future__ import annotations

from collections.abc import Iterator

from msrr_bullet.export.table import (
    EDGES,
    FRAME,
    POSE,
    SIGMA,
    STAMP,
    TIME,
    UNIT,
    Row,
    Table,
    columns,
    frame,
    one_of,
    pose,
    sigma,
    time,
    unit,
)
from msrr_bullet.log import BuiltErrors, CameraWindow, ClearanceRecord, Event, LogRecord, StartPoses, TruePose
from msrr_scenes.messages import (
    Detections,
    Exposure,
    GlobalPose,
    Localisation,
    LockFeedback,
    LockPosition,
    PoseMeasurement,
    SeatSwitches,
    WheelOdometry,
)

_CORNERS = ("bottom_left", "bottom_right", "top_right", "top_left")
_DETECTION_COLUMNS = columns(
    **UNIT,
    **FRAME,
    tag_id="identity of the tag",
    **{
        f"{corner}_{axis}_px": f"{axis} of the {corner.replace('_', ' ')} corner of the tag's own image"
        for corner in _CORNERS
        for axis in "xy"
    },
    decision_margin_grey="confidence of the detector",
    hamming="number of corrected bits",
    **{
        f"{corner}_sigma_px": f"standard deviation of each coordinate of the {corner.replace('_', ' ')} "
        "corner; empty if the detector does not tell"
        for corner in _CORNERS
    },
)


def _detection_rows(record: LogRecord, m: Detections | Localisation) -> Iterator[Row]:
    detections = m.detections if isinstance(m, Localisation) else m
    for tag in detections.tags:
        corners = map(float, tag.corners.ravel())
        sigmas = (None,) * 4 if tag.corner_sigma_px is None else map(float, tag.corner_sigma_px)
        values = (tag.tag_id, *corners, tag.decision_margin, tag.hamming, *sigmas)
        yield (*unit(record), *frame(detections.exposure), *values)


def _clearance_rows(record: LogRecord, m: ClearanceRecord) -> Iterator[Row]:
    nearest = (None,) * 4 if m.nearest is None else tuple(map(float, m.nearest.ravel()))
    yield time(record.stamp_ns), *m.pair, m.distance, *nearest


SENSOR_TABLES = (
    Table(
        "starts",
        "True pose of a body in the world at the start.",
        StartPoses,
        columns(body="name of the body", **POSE, redraws="number of random starts that were rejected"),
        lambda record, m: [(name, *pose(X_WB), m.redraws) for name, X_WB in m.poses.items()],
    ),
    Table(
        "as_built",
        "What was not as the scene says.",
        BuiltErrors,
        columns(
            quantity="part and quantity, which ends in its unit",
            error="true minus told value, in that unit",
        ),
        lambda record, m: list(m.errors.items()),
    ),
    Table(
        "truth",
        "True pose of a unit in the world at each decision.",
        TruePose,
        columns(**TIME, body="name of the unit", **POSE),
        lambda record, m: [(time(record.stamp_ns), m.name, *pose(m.X_WB))],
    ),
    Table(
        "clearance",
        "The smallest distance between two bodies that are neither docking nor locked together, from truth.",
        ClearanceRecord,
        columns(
            **TIME,
            body_a="name of one body",
            body_b="name of the other body",
            distance_m="distance of the two, negative when they overlap",
            a_x_m="nearest point of body_a in the world",
            a_y_m="nearest point of body_a in the world",
            b_x_m="nearest point of body_b in the world",
            b_y_m="nearest point of body_b in the world",
        ),
        _clearance_rows,
    ),
    Table(
        "exposures",
        "A frame that reached the computer.",
        Exposure,
        columns(**FRAME),
        lambda record, m: [frame(m)],
    ),
    Table(
        "windows",
        "A window read from a frame.",
        CameraWindow,
        columns(
            **FRAME,
            x_px="first column, from 0",
            y_px="first row, from 0",
            width_px="number of columns",
            height_px="number of rows",
        ),
        lambda record, m: [(*frame(m.exposure), m.window.x, m.window.y, m.window.width, m.window.height)],
    ),
    Table(
        "detections",
        "A tag found in a frame, with its corners as an ideal camera would see them.",
        Detections,
        _DETECTION_COLUMNS,
        _detection_rows,
    ),
    Table(
        "localisation",
        "A tag of an overhead frame as a localisation service with errors reports it.",
        Localisation,
        _DETECTION_COLUMNS,
        _detection_rows,
    ),
    Table(
        "odometry",
        "A reading of the wheel encoders.",
        WheelOdometry,
        columns(
            **UNIT,
            **STAMP,
            left_rad="angle that the left wheel has turned since power-up, forward positive",
            right_rad="the same for the right wheel",
        ),
        lambda record, m: [(*unit(record), time(m.stamp_ns), m.left, m.right)],
    ),
    Table(
        "seat_switches",
        "The switches in the holes, when they change.",
        SeatSwitches,
        columns(**UNIT, **STAMP, left="1 when the left one is pressed", right="the same for the right one"),
        lambda record, m: [(*unit(record), time(m.stamp_ns), m.left, m.right)],
    ),
    Table(
        "lock",
        "The position that the actuator of the lock reports, when it changes.",
        LockFeedback,
        columns(**UNIT, **STAMP, position=one_of(LockPosition)),
        lambda record, m: [(*unit(record), time(m.stamp_ns), m.position)],
    ),
    Table(
        "pose_measurements",
        "A pose in the dock frame as parametric perception measures it.",
        PoseMeasurement,
        columns(
            **UNIT,
            **FRAME,
            **POSE,
            **SIGMA,
            **EDGES,
        ),
        lambda record, m: [
            (*unit(record), *frame(m.exposure), *pose(m.X_DU), *sigma(m.covariance), *m.edge_bearings)
        ],
    ),
    Table(
        "global_measurements",
        "A pose in the world as parametric perception measures it.",
        GlobalPose,
        columns(
            **UNIT,
            body="name of the body",
            stamp_s="time of exposure by the clock of the overhead camera",
            **POSE,
            **SIGMA,
        ),
        lambda record, m: [(*unit(record), m.name, time(m.stamp_ns), *pose(m.X_WB), *sigma(m.covariance))],
    ),
    Table(
        "events",
        "A change of phase, a fault or the verdict, in words.",
        Event,
        columns(
            **TIME,
            level="debug, info, warning or error",
            source="name of the component that reports the event",
            text="the event in words",
        ),
        lambda record, m: [(time(record.stamp_ns), m.level.name.lower(), m.source, m.text)],
    ),
)
