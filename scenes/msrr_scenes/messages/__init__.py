"""Messages: the data that sensors, perception, control and the trial exchange.

All are frozen, small, and stamped with integer nanoseconds of simulated time. A measurement carries the time
of its *exposure*, never of its arrival. None of them carries truth.
"""

from msrr_scenes.messages.decisions import (
    Action,
    AssemblyPath,
    AssemblyProgress,
    Belief,
    CollisionMonitorState,
    Conviction,
    FailureReason,
    MonitorState,
    Phase,
    Twist,
)
from msrr_scenes.messages.estimates import (
    ArenaEstimate,
    LosObservation,
    LosStatus,
    ObstacleEstimate,
    PoseEstimate,
)
from msrr_scenes.messages.sensing import (
    NS_PER_S,
    Detections,
    Exposure,
    Fetch,
    GlobalPose,
    Localisation,
    LockFeedback,
    LockPosition,
    Pixels,
    PoseMeasurement,
    SeatSwitches,
    SensorMessage,
    TagDetection,
    WheelOdometry,
    seconds,
)

__all__ = [
    "NS_PER_S",
    "Action",
    "ArenaEstimate",
    "AssemblyPath",
    "AssemblyProgress",
    "Belief",
    "CollisionMonitorState",
    "Conviction",
    "Detections",
    "Exposure",
    "FailureReason",
    "Fetch",
    "GlobalPose",
    "Localisation",
    "LockFeedback",
    "LockPosition",
    "LosObservation",
    "LosStatus",
    "MonitorState",
    "ObstacleEstimate",
    "Phase",
    "Pixels",
    "PoseEstimate",
    "PoseMeasurement",
    "SeatSwitches",
    "SensorMessage",
    "TagDetection",
    "Twist",
    "WheelOdometry",
    "seconds",
]
