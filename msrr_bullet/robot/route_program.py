"""The program of a unit that drives a route into the open: by the overhead camera, without a target."""

from __future__ import annotations

from typing import Any

from msrr_bullet.profiler import NullProfiler, Profiler
from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_bullet.robot.interface import Estimates
from msrr_bullet.robot.overhead_localizer import OverheadLocalizer
from msrr_bullet.robot.wheel_speed import WheelSpeed
from msrr_control.sequence.observation import GiveUp, Observation
from msrr_control.staging.guided_assembler import GuidedAssembler
from msrr_scenes.messages import (
    Action,
    Belief,
    Conviction,
    Phase,
    SensorMessage,
    Twist,
    WheelOdometry,
)
from msrr_scenes.specs.scene import Scene


class RouteProgram:
    """Drives one granted route to its end.

    ``phase`` is ``assemble`` on the way, ``done`` at its end, and ``failed`` after giving up.
    """

    def __init__(
        self,
        scene: Scene,
        unit: str,
        guided: GuidedAssembler[Any],
        overhead: OverheadLocalizer,
        profiler: Profiler | None = None,
    ) -> None:
        """Set up for one route; ``overhead`` knows where all bodies are, and is fed by others."""
        geometry = scene.geometry(unit)
        self._unit, self._guided, self._overhead = unit, guided, overhead
        self.guard = CollisionMonitor(scene, unit)
        self._speed = WheelSpeed(geometry.wheel_radius, geometry.track)
        self._profiler = profiler or NullProfiler()
        self.phase = Phase.ASSEMBLE
        self.estimates = Estimates()
        self._passed: Twist | None = None

    def receive(self, message: SensorMessage) -> None:
        """Process a message that arrives now."""
        if isinstance(message, WheelOdometry):
            self._speed.add(message)

    def step(self, now_ns: int) -> Action:
        """Return the action of one control instant."""
        arena = self._overhead.estimate(now_ns, None)
        belief = self.estimates.belief
        twist, reason = Twist(), belief.reason
        if self.phase is Phase.ASSEMBLE:
            observation = Observation(
                now_ns,
                twist=self._speed.twist,
                arena=arena,
                overhead_exposed_ns=self._overhead.newest_ns,
                monitor=self.estimates.monitor,
                passed=self._passed,
            )
            decision = self._guided.step(observation)
            if isinstance(decision, GiveUp):
                self.phase, reason = Phase.FAILED, decision.reason
                belief = Belief(Conviction.GAVE_UP, decision.failure, reason)
            elif self._guided.finished:
                self.phase, reason = Phase.DONE, "at the end of the route"
            elif decision is not None:
                twist = decision
                progress = self._guided.progress
                if progress is not None:
                    reason = f"{progress.stage}: {progress.reason}{observation.held}"
        with self._profiler("collision monitor"):
            limited = self.guard.limit(twist, arena, now_ns)
        self._passed = limited.twist
        self.estimates = Estimates(
            arena=arena,
            monitor=limited.message(self._unit, now_ns),
            assembly=self._guided.progress if self.phase is Phase.ASSEMBLE else None,
            path=self._guided.path,
            belief=belief,
        )
        action = Action(now_ns, self.phase, 1, twist, reason=reason)
        return action if limited.twist is twist else action.with_twist(limited.twist)
