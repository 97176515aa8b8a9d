"""The rows that a message of the log gives in its table, in the order of the columns of ``tables.py``."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msrr_bullet.export.table import Row, time
from msrr_bullet.log import topics
from msrr_bullet.log.reader import LogRecord
from msrr_bullet.log.records import CameraWindow, Clearance, Event, StartPoses, StepStart, TruePose
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    Belief,
    Detections,
    Exposure,
    GlobalPose,
    Localisation,
    LockFeedback,
    LosObservation,
    ObstacleEstimate,
    PoseEstimate,
    PoseMeasurement,
    SeatSwitches,
    WheelOdometry,
)


def _pose(X: SE2) -> Row:
    return X.x, X.y, X.yaw


def _sigma(covariance: Array) -> Row:
    # A filter that diverged may have variances below zero; the rest of the row is still worth having.
    return tuple(math.sqrt(v) if v >= 0.0 else math.nan for v in map(float, covariance.diagonal()))


def _head(record: LogRecord) -> Row:
    return time(record.stamp_ns), topics.unit_of(record.topic)


def _exposed(exposure: Exposure) -> Row:
    return exposure.camera, exposure.frame, time(exposure.stamp_ns)


def steps(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a step of the plan."""
    m: StepStart = record.message
    yield time(record.stamp_ns), m.index, m.unit


def decisions(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a decision."""
    m: Action = record.message
    yield (*_head(record), m.attempt, m.phase, m.twist.v, m.twist.w, m.lock, m.reason)


def beliefs(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a belief."""
    m: Belief = record.message
    yield (*_head(record), m.conviction, m.setback, m.reason)


def estimates(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of an estimate."""
    m: PoseEstimate = record.message
    yield (
        *_head(record),
        time(m.stamp_ns),
        *_pose(m.X_DU),
        *_sigma(m.covariance),
        time(m.last_seen_ns),
    )


def sight(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a line of sight."""
    m: LosObservation = record.message
    yield (*_head(record), time(m.stamp_ns), m.status, m.left, m.right, m.margin)


def situation(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a situation."""
    m: ArenaEstimate = record.message
    known: list[tuple[str, GlobalPose | ObstacleEstimate]] = [("own", m.own), ("target", m.target)]
    known += [("other", body) for body in m.others] + [("obstacle", body) for body in m.obstacles]
    for role, body in known:
        radius = body.radius if isinstance(body, ObstacleEstimate) else None
        place = (*_pose(body.X_WB), *_sigma(body.covariance), radius)
        yield (*_head(record), role, body.name, time(body.stamp_ns), *place)


def assembly(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of the long-distance phase at one decision."""
    m: AssemblyProgress = record.message
    points = (*m.tip, *m.desired, *m.reference)
    yield (*_head(record), m.stage, m.path, *points, m.s, m.arc_end, m.length, m.avoiding, m.reason)


def paths(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a path."""
    m: AssemblyPath = record.message
    for i, point in enumerate(m.points):
        yield (*_head(record), m.number, m.shape, m.reason, i, *point)


def starts(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of the start."""
    m: StartPoses = record.message
    for name, X_WB in m.poses.items():
        yield name, *_pose(X_WB), m.redraws


def truth(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a true pose."""
    m: TruePose = record.message
    yield time(record.stamp_ns), m.name, *_pose(m.X_WB)


def clearance(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a clearance."""
    m: Clearance = record.message
    nearest = (None,) * 4 if m.nearest is None else tuple(map(float, m.nearest.ravel()))
    yield time(record.stamp_ns), *m.pair, m.distance, *nearest


def exposures(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of an exposure."""
    yield _exposed(record.message)


def windows(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a window."""
    m: CameraWindow = record.message
    yield *_exposed(m.exposure), m.window.x, m.window.y, m.window.width, m.window.height


def detections(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of detections, localised with errors or not."""
    m = record.message
    found: Detections = m.detections if isinstance(m, Localisation) else m
    for tag in found.tags:
        corners = map(float, tag.corners.ravel())
        values = (tag.tag_id, *corners, tag.decision_margin, tag.hamming)
        yield (*_head(record), *_exposed(found.exposure), *values)


def odometry(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of an encoder reading."""
    m: WheelOdometry = record.message
    yield (*_head(record), time(m.stamp_ns), m.left, m.right)


def switches(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of the seat switches."""
    m: SeatSwitches = record.message
    yield (*_head(record), time(m.stamp_ns), m.left, m.right)


def lock(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of the lock."""
    m: LockFeedback = record.message
    yield (*_head(record), time(m.stamp_ns), m.position)


def measurements(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a parametric measurement."""
    m: PoseMeasurement = record.message
    place = (*_pose(m.X_DU), *_sigma(m.covariance))
    yield (*_head(record), *_exposed(m.exposure), *place, *m.edge_bearings)


def global_measurements(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of a parametric measurement from above."""
    m: GlobalPose = record.message
    yield (*_head(record), m.name, time(m.stamp_ns), *_pose(m.X_WB), *_sigma(m.covariance))


def events(record: LogRecord) -> Iterator[Row]:
    """Yield the rows of an event."""
    m: Event = record.message
    yield time(record.stamp_ns), m.level.name.lower(), m.source, m.text
