"""The controller protocol, what a controller is given, and the controllers that ship."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol

import numpy as np

from msrr_control.docking.barrier import BarrierLaw, BarrierParams
from msrr_control.docking.c1 import C1DockingLaw, C1DockingParams, LinearParams
from msrr_control.docking.c2 import C2DockingLaw, C2DockingParams
from msrr_control.docking.graceful import GracefulLaw, GracefulParams
from msrr_control.docking.law import DockingLaw, DockSetup, Sensed, State
from msrr_control.parameters import read_params
from msrr_scenes.errors import SceneError
from msrr_scenes.messages import LosObservation, LosStatus, PoseEstimate, Twist
from msrr_scenes.registry import build
from msrr_scenes.specs.spec import Choice

#: Share of its speed that the guidance keeps, by how the line of sight came about.
_VISIBILITY = {LosStatus.SEEN: 1.0, LosStatus.PREDICTED: 0.5, LosStatus.LOST: 0.0}


@dataclass(frozen=True, slots=True, eq=False)
class ControlInputs:
    """What a controller is given at one control instant; estimates only.

    Attributes:
        now_ns: Time of the instant.
        dt: Time since the last one [s].
        pose: The unit in the dock frame of its target.
        los: Line of sight to the target, None before the first.
        twist: Measured by the wheel encoders.
    """

    now_ns: int
    dt: float
    pose: PoseEstimate
    los: LosObservation | None
    twist: Twist = field(default_factory=Twist)


class Controller(Protocol):
    """Drives the unit from the hand-over to the port.

    A scene names one by registered name or import path; it is built as ``Class(setup, **params)`` with a
    :class:`~msrr_control.docking.law.DockSetup` and the scene's ``control.docking.params``.
    """

    def reset(self, inputs: ControlInputs) -> None:
        """Begin an approach from here (the first one, or one after a retreat)."""
        ...

    def step(self, inputs: ControlInputs) -> Twist:
        """Return the command for this instant."""
        ...


class LawController(Generic[State]):
    """Runs an array law on one robot."""

    def __init__(self, law: DockingLaw[State]) -> None:
        """Wrap ``law``; the controller has no state before the first :meth:`reset`."""
        self.law = law
        self._state: State | None = None

    def reset(self, inputs: ControlInputs) -> None:
        """Begin an approach from here."""
        self._state = self.law.start(sense(inputs))

    def step(self, inputs: ControlInputs) -> Twist:
        """Return the command for this instant; the first call begins an approach."""
        sensed = sense(inputs)
        if self._state is None:
            self._state = self.law.start(sensed)
        command, self._state = self.law.step(self._state, sensed, inputs.dt)
        return Twist(float(command[0]), float(command[1]))


def sense(inputs: ControlInputs) -> Sensed:
    """Turn one robot's inputs into a law's arrays (no leading shape)."""
    los = inputs.los
    visibility = 0.0 if los is None else _VISIBILITY[los.status]
    edges = (0.0, 0.0) if los is None else (los.left, los.right)
    if not all(math.isfinite(a) for a in edges):
        edges, visibility = (0.0, 0.0), 0.0
    X_DU = inputs.pose.X_DU
    return Sensed(
        pose=np.array([X_DU.x, X_DU.y, X_DU.yaw]),
        edges=np.array(edges),
        visibility=np.array(visibility),
        twist=np.array([inputs.twist.v, inputs.twist.w]),
    )


def c1(setup: DockSetup, **params: Any) -> Controller:
    """Build the paper's close-range law C1."""
    return LawController(C1DockingLaw(read_params("c1", C1DockingParams, params), setup))


def c2(setup: DockSetup, **params: Any) -> Controller:
    """Build the comparison law C2 of the paper."""
    return LawController(C2DockingLaw(read_params("c2", C2DockingParams, params), setup))


def linear(setup: DockSetup, **params: Any) -> Controller:
    """Build plain linear tracking of the same guidance: no cone, no anti-windup, no nonlinear term."""
    return LawController(C1DockingLaw(read_params("linear", LinearParams, params).as_close_range(), setup))


def cbf(setup: DockSetup, **params: Any) -> Controller:
    """Build linear tracking behind the line-of-sight barrier."""
    return LawController(BarrierLaw(read_params("cbf", BarrierParams, params), setup))


def graceful(setup: DockSetup, **params: Any) -> Controller:
    """Build Park and Kuipers' pose-reaching law."""
    return LawController(GracefulLaw(read_params("graceful", GracefulParams, params), setup))


CONTROLLERS: dict[str, Callable[..., Controller]] = {
    "c1": c1,
    "c2": c2,
    "cbf": cbf,
    "graceful": graceful,
    "linear": linear,
}


def build_controller(choice: Choice, setup: DockSetup) -> Controller:
    """Build the controller that a scene chose.

    Raises:
        UnknownNameError: Neither a registered name nor an import path that leads anywhere.
        SceneError: Its parameters are wrong.
    """
    built = build("controller", choice, CONTROLLERS, setup)
    for method in ("reset", "step"):
        if not callable(getattr(built, method, None)):
            raise SceneError(f"controller {choice.name!r} has no method {method}(inputs)")
    return built
