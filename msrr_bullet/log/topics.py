"""Topics of a log. Cameras are named as in :class:`msrr_scenes.messages.Exposure`."""

from __future__ import annotations

from collections.abc import Callable

from msrr_bullet.log.codec import LogError
from msrr_scenes.messages import (
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    Belief,
    CollisionMonitorState,
    Detections,
    GlobalPose,
    Localisation,
    LockFeedback,
    LosObservation,
    PoseEstimate,
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
AS_BUILT = "/truth/as_built"
MISSION = "/coordination/mission"

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


def unit_of(topic: str) -> str:
    """Return the unit in a topic of the form ``/<group>/<unit>/<message>``.

    Raises:
        LogError: The topic has another form.
    """
    parts = topic.split("/")
    if len(parts) < 4:
        raise LogError(f"{topic}: no topic of a unit, /<group>/<unit>/<message>")
    return parts[2]


#: Topics of the exposures of a camera, and of the windows read from them, as functions of its name.
exposure, window = "/camera/{}/exposure".format, "/camera/{}/window".format

#: Topic of the true poses of a body, as a function of its name.
true_pose = "/truth/{}/pose".format

#: Topics of the estimates of a unit, as functions of its name: pose in the dock frame, line of sight, all
#: bodies.
estimate, los = "/perception/{}/estimate".format, "/perception/{}/los".format
situation = "/perception/{}/situation".format

#: Topics of the control of a unit, as functions of its name: decisions, what it believes of its step,
#: progress in the long-distance phase, paths of that phase.
action, belief = "/control/{}/action".format, "/control/{}/belief".format
monitor = "/control/{}/collision_monitor".format
assembly, path = "/control/{}/assembly".format, "/control/{}/path".format

#: Topics of the estimates of a unit and of what it believes, as functions of its name, by type of message.
ESTIMATES: dict[type, Callable[[str], str]] = {
    PoseEstimate: estimate,
    LosObservation: los,
    ArenaEstimate: situation,
    CollisionMonitorState: monitor,
    AssemblyProgress: assembly,
    AssemblyPath: path,
    Belief: belief,
}

#: Topics of the radio, as functions of the name of a unit: what the base station sends to it, what it
#: reports, and the arrival of either.
authority, authority_received = "/radio/{}/authority".format, "/radio/{}/authority_received".format
report, report_received = "/radio/{}/report".format, "/radio/{}/report_received".format

#: Topics for clients such as Foxglove and Rerun, in their own schemas: transforms of all bodies and lines of
#: the log; drawings in space; and, as functions of the name of a camera or of a unit, whole frames,
#: calibrations, what was found in a frame, the estimated pose, and the angles of the wheels.
TRANSFORMS, LOG_LINES = "/tf", "/log"
DRAWN_BODIES, DRAWN_ESTIMATES = "/scene", "/scene/estimates"
DRAWN_PATHS, DRAWN_ROUTES = "/scene/paths", "/scene/routes"
image, calibration = "/camera/{}/image".format, "/camera/{}/calibration".format
image_annotations = "/camera/{}/annotations".format
shown_estimate, joint_states = "/perception/{}/pose".format, "/joint_states/{}".format
