"""Tables of what the robot decided and believed; the reference describes them."""

from __future__ import annotations

from collections.abc import Iterator

from msrr_bullet.export.table import (
    EDGES,
    PHASE,
    POSE,
    SIGMA,
    STAMP,
    TIME,
    UNIT,
    Row,
    Table,
    columns,
    exposure_cells,
    exposures,
    one_of,
    pose,
    sigma,
    time,
    unit,
)
from msrr_bullet.log import LogRecord, StepStart
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    Belief,
    CollisionMonitorState,
    Conviction,
    FailureReason,
    GlobalPose,
    LosObservation,
    LosStatus,
    MonitorState,
    ObstacleEstimate,
    PoseEstimate,
)


def _situation_rows(record: LogRecord, m: ArenaEstimate) -> Iterator[Row]:
    bodies: list[tuple[str, GlobalPose | ObstacleEstimate]] = [("own", m.own)]
    bodies += [("target", m.target)] if m.target is not None else []
    bodies += [("other", body) for body in m.others] + [("obstacle", body) for body in m.obstacles]
    for role, body in bodies:
        radius = body.radius if isinstance(body, ObstacleEstimate) else None
        values = (*pose(body.X_WB), *sigma(body.covariance), radius)
        yield (*unit(record), role, body.name, time(body.stamp_ns), *values)


ROBOT_TABLES = (
    Table(
        "steps",
        "A step begins.",
        StepStart,
        columns(
            **TIME,
            step="index in the plan, or among the steps that a base station has begun, from 0",
            unit="name of the unit that docks or undocks",
            port="its active port",
            target="port that it docks to or leaves",
        ),
        lambda record, m: [] if m.in_the_open else [(time(record.stamp_ns), m.index, m.unit, m.port, m.to)],
    ),
    Table(
        "decisions",
        "Decision of the unit at one control instant.",
        Action,
        columns(
            **UNIT,
            attempt="number of the attempt, from 1",
            **PHASE,
            v_mps="commanded forward velocity",
            w_radps="commanded turn rate",
            lock="1 closes the lock, 0 opens it",
            reason="why the phase was entered",
        ),
        lambda record, m: [(*unit(record), m.attempt, m.phase, m.twist.v, m.twist.w, m.lock, m.reason)],
    ),
    Table(
        "beliefs",
        "What the unit believed of its step after each decision.",
        Belief,
        columns(
            **UNIT,
            conviction=f"verdict of the unit so far: {one_of(Conviction)}",
            setback=f"why the last attempt failed: {one_of(FailureReason)}",
            reason="why the last attempt failed, in words",
        ),
        lambda record, m: [(*unit(record), m.conviction, m.setback, m.reason)],
    ),
    Table(
        "estimates",
        "Estimated pose of the unit in the dock frame D of its target.",
        PoseEstimate,
        columns(
            **UNIT,
            **STAMP,
            **POSE,
            **SIGMA,
            last_seen_s="exposure of the last frame that was used, by the clock of the camera",
            **exposures(),
        ),
        lambda record, m: [
            (
                *unit(record),
                time(m.stamp_ns),
                *pose(m.X_DU),
                *sigma(m.covariance),
                time(m.last_seen_ns),
                *exposure_cells(m.exposures),
            )
        ],
    ),
    Table(
        "sight",
        "Line of sight to the target.",
        LosObservation,
        columns(
            **UNIT,
            **STAMP,
            status=one_of(LosStatus),
            **EDGES,
            margin_rad="angle between the border of the field of view and the nearer edge, negative outside",
        ),
        lambda record, m: [(*unit(record), time(m.stamp_ns), m.status, m.left, m.right, m.margin)],
    ),
    Table(
        "situation",
        "Estimated pose of a body in the world; one row for each body and decision.",
        ArenaEstimate,
        columns(
            **UNIT,
            role="own, target, other or obstacle",
            body="name of the body",
            **STAMP,
            **POSE,
            **SIGMA,
            radius_m="radius of the circle about the footprint of an obstacle",
        ),
        _situation_rows,
    ),
    Table(
        "collision_monitor",
        "Decision of the collision monitor on one command.",
        CollisionMonitorState,
        columns(
            **UNIT,
            **STAMP,
            state=one_of(MonitorState),
            body="nearest known body that matters",
            clearance_m="present distance from that body",
            ahead_m="smallest clearance along the trajectory of the command, less its uncertainty",
        ),
        lambda record, m: [
            (*unit(record), time(m.stamp_ns), m.state, m.body, m.clearance, m.ahead),
        ],
    ),
    Table(
        "assembly",
        "State of the long-distance phase at one decision; points in the world.",
        AssemblyProgress,
        columns(
            **UNIT,
            stage="stage of the long-distance phase",
            path="number of the path, 0 before the first",
            tip_x_m="controlled point, estimated",
            tip_y_m="controlled point, estimated",
            desired_x_m="desired point on the path",
            desired_y_m="desired point on the path",
            reference_x_m="reference point of the upper control layer",
            reference_y_m="reference point of the upper control layer",
            s_m="arc length of the desired point",
            arc_end_m="arc length at which the last arc ends",
            length_m="length of the path",
            avoiding="obstacle whose wall is in force",
            reason="why the stage was entered",
        ),
        lambda record, m: [
            (
                *(*unit(record), m.stage, m.path, *m.tip, *m.desired, *m.reference),
                *(m.s, m.arc_end, m.length, m.avoiding, m.reason),
            )
        ],
    ),
    Table(
        "paths",
        "Point, in the world, of a path that the long-distance phase chose.",
        AssemblyPath,
        columns(
            **UNIT,
            path="number of the path, from 1",
            shape="arc, around or staged; granted where a base station has planned it",
            reason="why it was chosen",
            point="number of the point, from 0",
            x_m="position",
            y_m="position",
        ),
        lambda record, m: [
            (*unit(record), m.number, m.shape, m.reason, i, *point) for i, point in enumerate(m.points)
        ],
    ),
)
