"""The interface of a robot: inputs and actions, and the estimates behind the actions."""

from __future__ import annotations

from typing import Protocol

from msrr_perception.tracking.body_track import SeenPoses
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
    def estimate(self) -> PoseEstimate | None:
        """Pose estimate on which the last decision was based."""
        ...

    @property
    def los(self) -> LosObservation | None:
        """Line of sight on which the last decision was based."""
        ...

    @property
    def arena(self) -> ArenaEstimate | None:
        """Estimate of all bodies in the arena on which the last decision was based."""
        ...

    @property
    def monitor(self) -> CollisionMonitorState | None:
        """Decision of the collision monitor on the last command; None without an overhead camera."""
        ...

    @property
    def assembly(self) -> AssemblyProgress | None:
        """Progress of the long-distance phase at the last decision; None in other phases."""
        ...

    @property
    def path(self) -> AssemblyPath | None:
        """Path that the long-distance phase follows or followed last."""
        ...

    @property
    def belief(self) -> Belief:
        """Belief of the robot about the outcome of the step."""
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
