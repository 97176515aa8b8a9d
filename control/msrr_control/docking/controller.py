"""The controller interface, its inputs, and the controllers that come with the package."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from msrr_control.docking.barrier import BarrierLaw, BarrierParams
from msrr_control.docking.c1 import C1DockingLaw, C1DockingParams, LinearParams
from msrr_control.docking.c2 import C2DockingLaw, C2DockingParams
from msrr_control.docking.graceful import GracefulLaw, GracefulParams
from msrr_control.docking.guidance import GuidanceSpec
from msrr_control.docking.law import DockingLaw, DockSetup, LawInputs, State
from msrr_control.parameters import read_params
from msrr_scenes.guarded import no_result, wrong
from msrr_scenes.messages import LosObservation, LosStatus, PoseEstimate, Twist, seconds
from msrr_scenes.registry import ExtensionPoint, build
from msrr_scenes.specs.spec import Choice, Spec
from msrr_scenes.specs.vehicle import LimitsSpec

P = TypeVar("P", bound=Spec)

#: Share of its speed that the guidance keeps, by the status of the line of sight.
_VISIBILITY = {LosStatus.SEEN: 1.0, LosStatus.PREDICTED: 0.5, LosStatus.LOST: 0.0}


@dataclass(frozen=True, slots=True, eq=False)
class ControlInputs:
    """What a controller is given at one control instant; estimates only.

    Attributes:
        now_ns: Time of the instant.
        dt: Time since the last instant [s].
        pose: Pose estimate of the unit in the dock frame of its target.
        los: Line of sight to the target, None before the first observation.
        twist: (v, w) as measured by the wheel encoders.
    """

    now_ns: int
    dt: float
    pose: PoseEstimate
    los: LosObservation | None
    twist: Twist = field(default_factory=Twist)


class Controller(Protocol):
    """Drives the unit from the hand-over to the port.

    A scene names a controller by registered name or import path; it is built as ``Class(setup, **params)``
    with a :class:`~msrr_control.docking.law.DockSetup` and the scene's ``control.docking.params``.

    A controller may have an attribute ``approach_mps``, the speed [m/s] at which it promises to approach; the
    docking phase then ends an approach that falls far behind it (see :func:`promised_speed`).
    """

    def reset(self, inputs: ControlInputs) -> None:
        """Begin an approach from here: the first one, or one after a retreat."""
        ...

    def step(self, inputs: ControlInputs) -> Twist:
        """Return the command for this instant."""
        ...


#: Builds a controller from the facts of a docking step and the parameters of a scene.
Factory = Callable[..., Controller]


class LawController(Generic[State]):
    """Runs an array law on one robot.

    Attributes:
        law: The law.
        approach_mps: Speed of the guidance trajectory of the law [m/s]; None for a law without one.
    """

    def __init__(self, law: DockingLaw[State]) -> None:
        """Wrap ``law``; the controller has no state before the first :meth:`reset`."""
        self.law = law
        guidance = getattr(getattr(law, "params", None), "guidance", None)
        self.approach_mps = guidance.speed_mps if isinstance(guidance, GuidanceSpec) else None
        self._state: State | None = None

    def reset(self, inputs: ControlInputs) -> None:
        """Begin an approach from here."""
        self._state = self.law.start(law_inputs(inputs))

    def step(self, inputs: ControlInputs) -> Twist:
        """Return the command for this instant; the first call begins an approach.

        Raises:
            ValueError: The law returned a command of another shape than (2,).
        """
        arrays = law_inputs(inputs)
        if self._state is None:
            self._state = self.law.start(arrays)
        command, self._state = self.law.step(self._state, arrays, inputs.dt)
        shape = np.shape(command)
        if shape != (2,):
            name = type(self.law).__name__
            raise ValueError(f"{name}.step returned a command of shape {shape}; expected (2,)")
        return Twist(float(command[0]), float(command[1]))


def promised_speed(controller: Controller, limits: LimitsSpec) -> float:
    """Return the speed [m/s] at which a controller promises to approach; 0 if it promises none.

    What a controller is told to promise may be more than its unit may drive in front of a port.
    """
    promised = getattr(controller, "approach_mps", None)
    return min(float(promised), limits.v_close_mps) if isinstance(promised, (int, float)) else 0.0


def law_inputs(inputs: ControlInputs) -> LawInputs:
    """Return one robot's inputs as the arrays of a law, without a leading shape."""
    los = inputs.los
    visibility = 0.0 if los is None else _VISIBILITY[los.status]
    left, right = (0.0, 0.0) if los is None else (los.left, los.right)
    if not (math.isfinite(left) and math.isfinite(right)):
        left = right = visibility = 0.0
    return LawInputs(
        pose=inputs.pose.X_DU.as_array(),
        edges=np.array([left, right]),
        visibility=np.array(visibility),
        twist=np.array([inputs.twist.v, inputs.twist.w]),
        age=np.array(seconds(inputs.now_ns - inputs.pose.stamp_ns)),
    )


def _controller(law: Callable[[P, DockSetup], DockingLaw[Any]], kind: type[P]) -> Factory:
    """Return a factory of controllers that run ``law`` with parameters of the given kind."""

    def build_law(setup: DockSetup, **params: Any) -> Controller:
        return LawController(law(read_params(kind, params), setup))

    return build_law


def checked_twist(result: object, *_: object) -> Twist:
    """Return the command of a class of a user's own.

    Raises:
        ValueError: It is no :class:`Twist`, or its velocities are not finite numbers.
    """
    if not isinstance(result, Twist):
        wrong(result, "a Twist")
    if not all(isinstance(u, Real) and math.isfinite(u) for u in (result.v, result.w)):
        wrong(result, "a Twist of two finite numbers")
    return Twist(float(result.v), float(result.w))


def _checked_speed(result: object) -> float | None:
    if result is None:
        return None
    if isinstance(result, bool) or not isinstance(result, Real) or not 0.0 <= float(result) < math.inf:
        wrong(result, "a speed of at least 0 m/s, or None")
    return float(result)


#: The controllers by the names that a scene gives them: the paper's C1, C2 (our reading of its
#: comparison), and three others.
CONTROLLERS: ExtensionPoint[Controller] = ExtensionPoint(
    "controller",
    {
        "c1": _controller(C1DockingLaw, C1DockingParams),
        "c2": _controller(C2DockingLaw, C2DockingParams),
        "cbf": _controller(BarrierLaw, BarrierParams),
        "graceful": _controller(GracefulLaw, GracefulParams),
        "linear": _controller(lambda params, setup: C1DockingLaw(params.as_c1(), setup), LinearParams),
    },
    methods={"reset": no_result, "step": checked_twist},
    optional={"approach_mps": _checked_speed},
)


def build_controller(choice: Choice, setup: DockSetup) -> Controller:
    """Build the controller that a scene names.

    Raises:
        UnknownNameError: The name is neither registered nor an import path that leads anywhere.
        SceneError: The parameters are wrong, or the class lacks a method.
    """
    return build("control.docking", choice, CONTROLLERS, setup)
