"""The interface of a docking law: a pure step over arrays, the same code for one robot and for a thousand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeVar

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.pin_and_hole import PinAndHole
from msrr_scenes.specs.control import LosSpec
from msrr_scenes.specs.vehicle import LimitsSpec

if TYPE_CHECKING:
    from msrr_scenes.specs.plan import DockStep
    from msrr_scenes.specs.scene import Scene


#: The age of inputs that describe the present, one for any number of trials.
_NO_AGE = np.zeros(())


class LawInputs(NamedTuple):
    """What a law is given at one control instant.

    Attributes:
        pose: Axle pose (x, y, yaw) in the dock frame D, shape (..., 3) [m, m, rad].
        edges: Line-of-sight angles (left, right) of the target's edges, shape (..., 2) [rad].
        visibility: 1 where the target is seen, 0 where lost, between where predicted; shape (...).
        twist: (v, w) as the encoders measure them now, shape (..., 2) [m/s, rad/s].
        age: Time since the instant that pose and edges describe, shape (...) [s]; 0 for an estimate of now,
            as an estimator with delay compensation gives it.
    """

    pose: Array
    edges: Array
    visibility: Array
    twist: Array
    age: Array = _NO_AGE


@dataclass(frozen=True, slots=True)
class DockSetup:
    """The fixed facts of one docking step, from the unit's geometry and the scene.

    Attributes:
        offset: l, distance of the active port's face ahead of the axle [m].
        camera_offset: l_c, distance of the camera ahead of the axle [m].
        pin_reach: Distance by which the pins stick out beyond the face [m].
        mouth: Lateral error up to which the pins pass the mouths of the holes [m].
        pins: Places of the left and the right pin on the face, left of its middle positive [m].
        los: Line-of-sight target and cone.
        limits: What the drive can do.
        rate_hz: Control rate.
        link_latency_s: Time that a command takes to the drive.
        close_time_s: Time that the lock takes to close.
        lock_delay_s: Longest time from a command to the lock to a report of what has come of it, if that
            takes no time by itself.
        smear_mps: Speed across the line of sight at which a tag of the port moves by one module of its code
            while the shutter of the camera is open [m/s].

    Raises:
        SceneError: The port does not lie ahead of the axle, or at contact the camera is beyond the
            line-of-sight target or sees its edges outside the inner cone.
    """

    offset: float
    camera_offset: float
    pin_reach: float
    mouth: float
    pins: tuple[float, float]
    los: LosSpec
    limits: LimitsSpec
    rate_hz: float
    link_latency_s: float = 0.0
    close_time_s: float = 0.0
    lock_delay_s: float = 0.0
    smear_mps: float = math.inf

    def __post_init__(self) -> None:
        if not self.offset > 0.0:
            raise SceneError(f"the active port has to lie ahead of the axle; its offset is {self.offset} m")
        reach = self.offset - self.camera_offset + self.los.setback_m
        if reach <= 0.0:
            raise SceneError(
                f"the camera sits {-reach:.4f} m beyond the line-of-sight target when docked; move it back"
            )
        angle = self.los.angle_at_contact(self.offset - self.camera_offset)
        if angle >= self.los.inner:
            raise SceneError(
                f"los.inner_deg: a unit at contact sees the target's edges at {np.degrees(angle):.1f} deg, "
                f"not inside {self.los.inner_deg:g}: it would park short of the port"
            )

    @classmethod
    def of(cls, scene: Scene, step: DockStep) -> DockSetup:
        """Read the facts of a step of the plan from the scene and the docking unit's URDF.

        Raises:
            SceneError: As for the class.
            GeometryError: A URDF lacks a frame, or the pins or holes, of the step.
        """
        geometry = scene.geometry(step.unit)
        offset = geometry.control_offset(step.port)
        target = scene.geometry(step.target_unit)
        mechanism = PinAndHole.of(geometry, step.port, target, step.target_port)
        return cls(
            offset=offset,
            camera_offset=float(geometry.frame("camera").p[0]),
            pin_reach=mechanism.pin_length,
            mouth=mechanism.mouth,
            pins=mechanism.pins,
            los=scene.los,
            limits=scene.limits,
            rate_hz=scene.control.rate_hz,
            link_latency_s=1e-3 * scene.link.latency_ms,
            close_time_s=scene.lock.close_time_s,
            lock_delay_s=1e-3 * scene.link.latency_ms + 1.0 / scene.odometry.rate_hz,
            smear_mps=_smear_mps(scene, step),
        )

    def readable_turn(self, gap: float) -> float:
        """Return the turn rate [rad/s] up to which the camera reads the tags of the port at a gap [m].

        At that rate a tag moves by one module of its code while the shutter is open, which leaves 64 % of
        the contrast of its finest pattern; at twice that rate nothing is left. As a camera turns, all tags
        move by as many pixels, and the farther one is, the smaller are its modules: the focal length cancels
        out.
        """
        distance = max(gap, 0.0) + self.offset - self.camera_offset + self.los.setback_m
        return self.smear_mps / distance


def _smear_mps(scene: Scene, step: DockStep) -> float:
    """Return ``DockSetup.smear_mps`` for the largest tag of a port; infinite without pixels."""
    exposure_s = 1e-3 * scene.cameras.onboard.exposure_ms
    if scene.perception != "images" or exposure_s == 0.0:
        return math.inf
    slots = scene.geometry(step.target_unit).marker_slots(step.target_port)
    largest = max((scene.tag_size(step.target_unit, slot) for slot in slots), default=math.inf)
    return largest / scene.tags.tag_family.edge_modules / exposure_s


State = TypeVar("State")


class DockingLaw(Protocol[State]):
    """A close-range law with explicit state: the law itself keeps nothing between calls."""

    def start(self, inputs: LawInputs) -> State:
        """Return the state with which an approach begins from here."""
        ...

    def step(self, state: State, inputs: LawInputs, dt: float) -> tuple[Array, State]:
        """Advance the law by one control period.

        Args:
            state: State of the law.
            inputs: Pose, line of sight and twist, leading shape (...).
            dt: Control period [s].

        Returns:
            The commanded (v, w) within the drive's speed limits, shape (..., 2), and the next state.
        """
        ...

    def reference(self, state: State) -> Array:
        """Return the point of the guidance trajectory in D, shape (..., 2) [m]; NaN if there is none."""
        ...
