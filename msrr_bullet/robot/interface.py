"""The interface of a robot: inputs and actions, and the estimates behind the actions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

from msrr_perception.tracking.seen_pose import SeenPoses
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    Belief,
    CollisionMonitorState,
    Detections,
    Exposure,
    Fetch,
    LosObservation,
    PoseEstimate,
    SensorMessage,
)
from msrr_scenes.messages.coordination import Authority, UnitReport
from msrr_scenes.specs.plan import DockStep


class Estimates(NamedTuple):
    """What a robot estimates and believes at one decision, in the order of the log.

    Attributes:
        pose: Pose of the unit in the dock frame on which the decision was based; None before one is known.
        los: Line of sight to the target on which it was based; None before the first.
        arena: Poses of all bodies on which it was based; None without an overhead camera.
        monitor: What the collision monitor made of the command; None without an overhead camera.
        assembly: Progress of the long-distance phase; None in other phases.
        path: Path that the long-distance phase follows or followed last; None before one.
        belief: What the robot believes about the outcome of the step.
    """

    pose: PoseEstimate | None = None
    los: LosObservation | None = None
    arena: ArenaEstimate | None = None
    monitor: CollisionMonitorState | None = None
    assembly: AssemblyProgress | None = None
    path: AssemblyPath | None = None
    belief: Belief = Belief()

    def messages(self, last: Estimates) -> Iterator[object]:
        """Yield what a log holds of this decision: all that is known, and the path if it is a new one."""
        for message in self:
            if message is not None and message is not last.path:
                yield message


class CameraReader(Protocol):
    """A program that reads the pictures of cameras."""

    def uses_camera(self, camera: str) -> bool:
        """Return whether the program uses the frames of ``camera`` now."""
        ...

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Read windows of an exposure through ``fetch`` and return what was detected in them.

        The program knows the detections only once it receives them, after the latency of the camera.
        """
        ...


class Robot(CameraReader, Protocol):
    """The software of one unit."""

    def receive(self, message: SensorMessage) -> None:
        """Process a sensor message that arrives now."""
        ...

    def step(self, now_ns: int) -> Action:
        """Return the action of one control instant."""
        ...


class ObservableRobot(Robot, Protocol):
    """A robot that shows its estimates, such as :class:`msrr_bullet.robot.autonomy.Autonomy`."""

    @property
    def estimates(self) -> Estimates:
        """What the robot estimates and believes, as of its last decision."""
        ...


class LedRobot(ObservableRobot, Protocol):
    """A robot that a base station leads, such as :class:`msrr_bullet.robot.guided_unit.GuidedUnit`."""

    @property
    def active(self) -> bool:
        """Whether the robot has something to do; else it is on standby and needs no sensors."""
        ...

    @property
    def route(self) -> int:
        """Number of the route that the robot drives or drove last."""
        ...

    @property
    def docked_to(self) -> str | None:
        """Port ``<unit>.<port>`` into which the robot believes that it is locked; None if it is free."""
        ...

    @property
    def dock_step(self) -> DockStep | None:
        """Docking or undocking of the present route; None without one."""
        ...

    @property
    def leaving(self) -> bool:
        """Whether the robot is on its way out of a port."""
        ...

    def see(self, seen_poses: SeenPoses) -> None:
        """Take in what the base station has read from an overhead exposure."""
        ...

    def authorise(self, authority: Authority) -> None:
        """Process an authority that arrives now."""
        ...

    def report(self, now_ns: int) -> UnitReport:
        """Return what is told to the base station."""
        ...
