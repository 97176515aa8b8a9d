"""Topics of a log. Cameras are named as in :class:`msrr_scenes.messages.Exposure`."""

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
    """Return the topic of a sensor message that reaches the robot ``unit``."""
    return _SENSORS[type(message)].format(unit)


def exposure(camera: str) -> str:
    """Return the topic of the exposures of a camera."""
    return f"/camera/{camera}/exposure"


def window(camera: str) -> str:
    """Return the topic of the windows read from a camera."""
    return f"/camera/{camera}/window"


def estimate(unit: str) -> str:
    """Return the topic of the pose estimates of a unit."""
    return f"/perception/{unit}/estimate"


def los(unit: str) -> str:
    """Return the topic of the line of sight of a unit."""
    return f"/perception/{unit}/los"


def action(unit: str) -> str:
    """Return the topic of the decisions of a unit."""
    return f"/control/{unit}/action"


def belief(unit: str) -> str:
    """Return the topic of what a unit believes of its step: docked or not, and why."""
    return f"/control/{unit}/belief"


def assembly(unit: str) -> str:
    """Return the topic of the progress of a unit in its long-distance phase."""
    return f"/control/{unit}/assembly"


def path(unit: str) -> str:
    """Return the topic of the paths that the long-distance phase of a unit chooses."""
    return f"/control/{unit}/path"


def situation(unit: str) -> str:
    """Return the topic of the estimates that a unit has of all bodies in the arena."""
    return f"/perception/{unit}/situation"


def true_pose(name: str) -> str:
    """Return the topic of the true poses of a body."""
    return f"/truth/{name}/pose"


def unit_of(topic: str) -> str:
    """Return the unit in a topic of the form ``/<group>/<unit>/<message>``."""
    return topic.split("/")[2]
