"""The topics of a log. ``camera`` is a camera's name as in :class:`msrr_scenes.messages.Exposure`."""

from __future__ import annotations

from msrr_scenes.messages import (
    Detections,
    GlobalPose,
    Localisation,
    LockFeedback,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
    WheelOdometry,
)

EVENTS = "/events"
FRAMES = "/frames"
STEPS = "/plan/step"
CLEARANCE = "/truth/clearance"
STARTS = "/truth/start"

_SENSORS: dict[type, str] = {
    WheelOdometry: "/sensors/{}/odometry",
    SeatSwitches: "/sensors/{}/seat_switches",
    LockFeedback: "/sensors/{}/lock",
    PoseMeasurement: "/sensors/{}/pose",
    GlobalPose: "/sensors/{}/global_pose",
    Localisation: "/sensors/{}/localisation",
    Detections: "/perception/{}/detections",
}


def sensor(unit: str, message: SensorMessage) -> str:
    """Return the topic of a message that reaches the robot ``unit``."""
    return _SENSORS[type(message)].format(unit)


def exposure(camera: str) -> str:
    """Return the topic of a camera's exposures."""
    return f"/camera/{camera}/exposure"


def window(camera: str) -> str:
    """Return the topic of the windows read from a camera."""
    return f"/camera/{camera}/window"


def estimate(unit: str) -> str:
    """Return the topic of a unit's belief where it is."""
    return f"/perception/{unit}/estimate"


def los(unit: str) -> str:
    """Return the topic of a unit's line of sight."""
    return f"/perception/{unit}/los"


def action(unit: str) -> str:
    """Return the topic of a unit's decisions."""
    return f"/control/{unit}/action"


def belief(unit: str) -> str:
    """Return the topic of a unit's verdict on its step."""
    return f"/control/{unit}/belief"


def assembly(unit: str) -> str:
    """Return the topic of a unit's progress in the long-distance phase."""
    return f"/control/{unit}/assembly"


def path(unit: str) -> str:
    """Return the topic of the paths that a unit's long-distance phase chooses."""
    return f"/control/{unit}/path"


def situation(unit: str) -> str:
    """Return the topic of what a unit knows of the whole arena."""
    return f"/perception/{unit}/situation"


def true_pose(name: str) -> str:
    """Return the topic of a body's true pose."""
    return f"/truth/{name}/pose"


def unit_of(topic: str) -> str:
    """Return the unit in a topic of the form ``/<room>/<unit>/<what>``."""
    return topic.split("/")[2]
