"""The interface of a robot: inputs and actions, and the estimates behind the actions."""

from __future__ import annotations

from typing import Protocol

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


class Robot(Protocol):
    """One docking unit during one step of the plan."""

    def uses_camera(self, camera: str) -> bool:
        """Return whether the robot uses the frames of ``camera`` in its present phase."""
        ...

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections | None:
        """Read windows of an exposure through ``fetch`` and return what was detected in them.

        The robot knows the detections only once it receives them, after the latency of the camera.
        """
        ...

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
