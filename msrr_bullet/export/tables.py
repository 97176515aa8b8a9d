"""The tables of a log, one for each kind of message; documented in ``docs/csv.md``."""

from __future__ import annotations

from msrr_bullet.export import rows
from msrr_bullet.export.table import Table, columns
from msrr_bullet.log.records import CameraWindow, Clearance, Event, StartPoses, StepStart, TruePose
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
    PoseEstimate,
    PoseMeasurement,
    SeatSwitches,
    WheelOdometry,
)

_TIME = {"time_s": "simulated time at which it happened or arrived"}
_UNIT = {**_TIME, "unit": "the docking unit"}
_STAMP = {"stamp_s": "time that the values speak of"}
_POSE = {"x_m": "position", "y_m": "position", "yaw_rad": "heading, counter-clockwise positive"}
_SIGMA = {
    "sigma_x_m": "standard deviation of x",
    "sigma_y_m": "standard deviation of y",
    "sigma_yaw_rad": "standard deviation of the heading",
}
_FRAME = {"camera": "name of the camera", "frame": "number of the frame", "exposed_s": "time of exposure"}
_NAMED_CORNERS = ("bottom_left", "bottom_right", "top_right", "top_left")


_CORNERS = {
    f"{corner}_{axis}_px": f"{axis} of the tag's {corner.replace('_', ' ')} corner"
    for corner in _NAMED_CORNERS
    for axis in "xy"
}
_DETECTIONS = columns(
    **_UNIT,
    **_FRAME,
    tag_id="identity of the tag",
    **_CORNERS,
    decision_margin_grey="the detector's confidence",
    hamming="corrected bits",
)

TABLES = (
    Table(
        "steps",
        "A step of the plan begins.",
        columns(**_TIME, step="index in the plan, from 0", unit="the docking unit"),
        StepStart,
        rows.steps,
    ),
    Table(
        "decisions",
        "What the unit decided at one control instant.",
        columns(
            **_UNIT,
            attempt="counted from 1",
            phase="phase of the docking step",
            v_mps="forward velocity commanded",
            w_radps="turn rate commanded",
            lock="1 closes the lock, 0 opens it",
            reason="why the phase was entered",
        ),
        Action,
        rows.decisions,
    ),
    Table(
        "beliefs",
        "What the unit held true about its step, after each decision.",
        columns(
            **_UNIT,
            conviction="its verdict so far",
            setback="why the last attempt failed",
            reason="the same in words",
        ),
        Belief,
        rows.beliefs,
    ),
    Table(
        "estimates",
        "Where the unit believed to be in the dock frame D of its target.",
        columns(**_UNIT, **_STAMP, **_POSE, **_SIGMA, last_seen_s="exposure of the last sight that counted"),
        PoseEstimate,
        rows.estimates,
    ),
    Table(
        "sight",
        "Line of sight to the target.",
        columns(
            **_UNIT,
            **_STAMP,
            status="seen, predicted or lost",
            left_rad="angle of the target's left edge",
            right_rad="angle of its right edge",
            margin_rad="distance of the nearer edge from the border of the field of view",
        ),
        LosObservation,
        rows.sight,
    ),
    Table(
        "situation",
        "Where the unit believed a body to stand in the world; one row for each body and decision.",
        columns(
            **_UNIT,
            role="own, target, other or obstacle",
            body="name of the body",
            **_STAMP,
            **_POSE,
            **_SIGMA,
            radius_m="radius about an obstacle's footprint",
        ),
        ArenaEstimate,
        rows.situation,
    ),
    Table(
        "assembly",
        "The long-distance phase at one decision; points in the world.",
        columns(
            **_UNIT,
            stage="what the unit does",
            path="number of the path, 0 before the first",
            tip_x_m="controlled point, estimated",
            tip_y_m="controlled point, estimated",
            desired_x_m="where it should be on the path",
            desired_y_m="where it should be on the path",
            reference_x_m="where the upper layer lets it go to",
            reference_y_m="where the upper layer lets it go to",
            s_m="arc length of the desired point",
            arc_end_m="arc length at which the last arc ends",
            length_m="length of the path",
            avoiding="obstacle whose wall stands",
            reason="why the stage was entered",
        ),
        AssemblyProgress,
        rows.assembly,
    ),
    Table(
        "paths",
        "A point of a path that the long-distance phase chose.",
        columns(
            **_UNIT,
            path="number of the path, from 1",
            shape="arc, around or staged",
            reason="why it was chosen",
            point="number of the point, from 0",
            x_m="position",
            y_m="position",
        ),
        AssemblyPath,
        rows.paths,
    ),
    Table(
        "starts",
        "Where a body was set down, in truth.",
        columns(body="name of the body", **_POSE, redraws="starts of this trial that were drawn again"),
        StartPoses,
        rows.starts,
    ),
    Table(
        "truth",
        "Where a unit was in truth, at each decision.",
        columns(**_TIME, body="name of the unit", **_POSE),
        TruePose,
        rows.truth,
    ),
    Table(
        "clearance",
        "The smallest distance between two bodies, from truth.",
        columns(
            **_TIME,
            body_a="one body",
            body_b="the other",
            distance_m="their distance, negative when they overlap",
            a_x_m="nearest point of body_a",
            a_y_m="nearest point of body_a",
            b_x_m="nearest point of body_b",
            b_y_m="nearest point of body_b",
        ),
        Clearance,
        rows.clearance,
    ),
    Table("exposures", "A frame that reached the computer.", columns(**_FRAME), Exposure, rows.exposures),
    Table(
        "windows",
        "A window read from a frame.",
        columns(
            **_FRAME,
            x_px="first column",
            y_px="first row",
            width_px="columns",
            height_px="rows",
        ),
        CameraWindow,
        rows.windows,
    ),
    Table("detections", "A tag found in a frame.", _DETECTIONS, Detections, rows.detections),
    Table(
        "localisation",
        "A tag of an overhead frame where a localisation service with errors believes it.",
        _DETECTIONS,
        Localisation,
        rows.detections,
    ),
    Table(
        "odometry",
        "A reading of the wheel encoders.",
        columns(
            **_UNIT, **_STAMP, left_rad="angle turned since power-up", right_rad="angle turned since power-up"
        ),
        WheelOdometry,
        rows.odometry,
    ),
    Table(
        "seat_switches",
        "The switches in the holes, when they change.",
        columns(**_UNIT, **_STAMP, left="1 when pressed", right="1 when pressed"),
        SeatSwitches,
        rows.switches,
    ),
    Table(
        "lock",
        "Where the lock's cam says it is, when it changes.",
        columns(**_UNIT, **_STAMP, position="open, closing or closed"),
        LockFeedback,
        rows.lock,
    ),
    Table(
        "pose_measurements",
        "A pose in the dock frame as parametric perception measures it.",
        columns(
            **_UNIT,
            **_FRAME,
            **_POSE,
            **_SIGMA,
            left_rad="bearing of the target's left edge",
            right_rad="bearing of its right edge",
        ),
        PoseMeasurement,
        rows.measurements,
    ),
    Table(
        "global_measurements",
        "A pose in the world as parametric perception measures it.",
        columns(**_UNIT, body="name of the body", **_STAMP, **_POSE, **_SIGMA),
        GlobalPose,
        rows.global_measurements,
    ),
    Table(
        "events",
        "Something worth a line.",
        columns(**_TIME, level="debug, info, warning or error", source="who speaks", text="what they say"),
        Event,
        rows.events,
    ),
)
