"""Specifications of what is not as designed: how far true values may be from what the robots were told.

A scene, its URDFs and its data sheets say what everybody is told: the drawing. Here every quantity that a
maker can get wrong has a standard deviation, which a robot may know as a tolerance, and may have a true
error, which it may not. :mod:`msrr_scenes.as_built` draws the truth of a trial.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import model_validator

from msrr_scenes.specs.deviations import (
    AngleDeviation,
    ClockDeviation,
    CoefficientDeviation,
    DelayDeviation,
    Deviation,
    FrictionDeviation,
    HeightDeviation,
    LengthDeviation,
    PixelDeviation,
    PlayDeviation,
    RatioDeviation,
    SpeedDeviation,
    is_number,
)
from msrr_scenes.specs.spec import Spec

Grade = Literal["perfect", "careful", "workshop", "rough"]

#: Standard deviations of each grade over those of ``careful``.
GRADES: Mapping[Grade, float] = {"perfect": 0.0, "careful": 1.0, "workshop": 2.0, "rough": 4.0}

_CAREFUL_MOUNT = {axis: 0.0007 for axis in ("x_m", "y_m", "z_m")} | {
    axis: 0.3 for axis in ("roll_deg", "pitch_deg", "yaw_deg")
}
_CAREFUL_CAMERA = _CAREFUL_MOUNT | {
    "focal_percent": 0.4,
    "cx_px": 2.0,
    "cy_px": 2.0,
    "k1": 0.01,
    "clock_ms": 8.0,
}

#: Standard deviations of the grade ``careful``, by group and quantity. What is not listed is as designed.
CAREFUL: Mapping[str, Mapping[str, float]] = {
    "onboard": _CAREFUL_CAMERA,
    "overhead": _CAREFUL_CAMERA,
    "tags": _CAREFUL_MOUNT | {"x_m": 0.0003, "y_m": 0.0003, "z_m": 0.0003, "print_percent": 0.4},
    "bracket": _CAREFUL_MOUNT,
    "drive": {
        "radius_left_percent": 1.0,
        "radius_right_percent": 1.0,
        "track_percent": 1.0,
        "lag_ms": 50.0,
        "backlash_deg": 2.0,
    },
    "floor": {"friction_percent": 50.0, "slope_x_deg": 0.3, "slope_y_deg": 0.3},
}


def graded_optics(grade: Grade) -> dict[str, float]:
    """Return noise, blur, tone curve and exposure time of the cameras of a grade; none if it is perfect.

    They are no deviations: a robot knows the data sheet of its camera. Noise and exposure grow with the
    grade. Blur grows with its square root, for at twice the blur of ``careful`` no tag of a port 0.7 m away
    is read.
    """
    factor = GRADES[grade]
    if factor == 0.0:
        return {}
    return {
        "noise_grey": 4.0 * factor,
        "blur_px": round(0.8 * math.sqrt(factor), 3),
        "gamma": round(1.2**factor, 3),
        "exposure_ms": 10.0 * factor,
    }


def graded_odometry(grade: Grade) -> dict[str, float]:
    """Return the errors of the encoders of a grade; none of its own if it is perfect.

    Wheels that were built with errors have them in their motion, and not in the readings alone as well.
    """
    return {} if GRADES[grade] == 0.0 else {"scale_error": 0.0}


class MountDeviations(Spec):
    """Deviations of how a part is mounted: in its own frame, turned by Rz(yaw) Ry(pitch) Rx(roll)."""

    x_m: LengthDeviation = LengthDeviation()
    """Place along x [m]."""
    y_m: LengthDeviation = LengthDeviation()
    """Place along y [m]."""
    z_m: LengthDeviation = LengthDeviation()
    """Place along z [m]."""
    roll_deg: AngleDeviation = AngleDeviation()
    """Angle about x [deg]."""
    pitch_deg: AngleDeviation = AngleDeviation()
    """Angle about y [deg]."""
    yaw_deg: AngleDeviation = AngleDeviation()
    """Angle about z [deg]."""


class CameraDeviations(MountDeviations):
    """Deviations of a camera; its frame has x along the optical axis, y left and z up in the image."""

    focal_percent: RatioDeviation = RatioDeviation()
    """Focal length [%]."""
    cx_px: PixelDeviation = PixelDeviation()
    """Column of the principal point [px]."""
    cy_px: PixelDeviation = PixelDeviation()
    """Row of the principal point [px]."""
    k1: CoefficientDeviation = CoefficientDeviation()
    """Radial distortion by r^2 (Brown-Conrady, as in OpenCV)."""
    k2: CoefficientDeviation = CoefficientDeviation()
    """Radial distortion by r^4."""
    p1: CoefficientDeviation = CoefficientDeviation()
    """First tangential distortion."""
    p2: CoefficientDeviation = CoefficientDeviation()
    """Second tangential distortion."""
    k3: CoefficientDeviation = CoefficientDeviation()
    """Radial distortion by r^6."""
    clock_ms: ClockDeviation = ClockDeviation()
    """Time that the clock of the camera is ahead of that of the computer [ms]."""
    jitter_ms: DelayDeviation = DelayDeviation()
    """Largest delay of a frame beyond the latency, drawn for each frame [ms]."""


class TagDeviations(MountDeviations):
    """Deviations of every tag on its own; its frame has x right, y down and z into the tag."""

    print_percent: RatioDeviation = RatioDeviation()
    """Size of the print [%]; all tags of a unit come from one printer."""


class DriveDeviations(Spec):
    """Deviations of the drive of a unit, in its motion: encoders and drive go by the nominal wheels."""

    radius_left_percent: RatioDeviation = RatioDeviation()
    """Radius of the left wheel [%]."""
    radius_right_percent: RatioDeviation = RatioDeviation()
    """Radius of the right wheel [%]."""
    track_percent: RatioDeviation = RatioDeviation()
    """Distance between the wheels [%]."""
    lag_ms: DelayDeviation = DelayDeviation()
    """Time constant with which the speed of a motor follows its command [ms]."""
    dead_zone_radps: SpeedDeviation = SpeedDeviation()
    """Speed of a wheel below which the motor does not turn it [rad/s]."""
    backlash_deg: PlayDeviation = PlayDeviation()
    """Play between the motor, whose angle the encoder measures, and the wheel [deg]."""

    @property
    def longest_lag_s(self) -> float:
        """Time [s] by which the motors lag at most: two standard deviations, which 5 % of drives exceed."""
        return 2e-3 * self.lag_ms.sigma


class BodyDeviations(Spec):
    """Deviations of the body of a unit."""

    mass_percent: RatioDeviation = RatioDeviation()
    """Mass of every part [%]."""
    switch_travel_m: LengthDeviation = LengthDeviation()
    """Distance from the bottom of the hole at which the seat switches close [m]."""


class FloorDeviations(Spec):
    """Deviations of the floor, which is told to be level, even and of a known friction."""

    friction_percent: FrictionDeviation = FrictionDeviation()
    """Friction [%]."""
    slope_x_deg: AngleDeviation = AngleDeviation()
    """Slope along x of the world, positive where it rises [deg]."""
    slope_y_deg: AngleDeviation = AngleDeviation()
    """Slope along y of the world, positive where it rises [deg]."""
    ridge_m: HeightDeviation = HeightDeviation()
    """Height of the ridges at the joints of the floor, every half metre both ways [m]."""


class AsBuiltSpec(Spec):
    """What is not as designed; ``as_built: careful`` is the short form of ``as_built: {grade: careful}``."""

    grade: Grade = "perfect"
    """Grade of the workmanship, which gives every standard deviation that is not given."""
    onboard: CameraDeviations = CameraDeviations()
    """Onboard camera of every unit."""
    overhead: CameraDeviations = CameraDeviations()
    """Overhead camera."""
    tags: TagDeviations = TagDeviations()
    """Every tag on its own."""
    bracket: MountDeviations = MountDeviations()
    """Bracket of the marker of every port, which moves its tags together, about their middle; its frame has x
    into the unit, y left as seen by a unit that docks, and z up."""
    drive: DriveDeviations = DriveDeviations()
    """Drive of every unit."""
    body: BodyDeviations = BodyDeviations()
    """Body of every unit."""
    floor: FloorDeviations = FloorDeviations()
    """Floor."""

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, data: Any) -> Any:
        if isinstance(data, str):
            data = {"grade": data}
        grade = data.get("grade") if isinstance(data, dict) else None
        factor = next((factor for name, factor in GRADES.items() if name == grade), 0.0)
        if factor == 0.0:
            return data
        groups = {name: _graded(data.get(name), sigmas, factor) for name, sigmas in CAREFUL.items()}
        return {**data, **groups}

    def deviations(self) -> Iterator[tuple[str, str, Deviation]]:
        """Yield group, name and deviation of every quantity."""
        for group in type(self).model_fields:
            if group != "grade":
                for quantity, deviation in getattr(self, group):
                    yield group, quantity, deviation

    def told(self) -> AsBuiltSpec:
        """Return the tolerances without any true error: what a robot may know."""
        groups: dict[str, dict[str, Deviation]] = {}
        for group, quantity, deviation in self.deviations():
            groups.setdefault(group, {})[quantity] = deviation.model_copy(update={"error": None})
        updates = {group: getattr(self, group).model_copy(update=told) for group, told in groups.items()}
        return self.model_copy(update=updates)

    def __str__(self) -> str:
        """Return the grade, with the quantities that are not as the grade has them."""
        graded = AsBuiltSpec(grade=self.grade)
        changed = [
            f"{group}.{quantity}" if own.error is None else f"{group}.{quantity} = {own.error:g}"
            for (group, quantity, own), (_, _, usual) in zip(
                self.deviations(), graded.deviations(), strict=True
            )
            if own != usual
        ]
        return f"{self.grade} but for {', '.join(changed)}" if changed else self.grade


def _graded(given: Any, sigmas: Mapping[str, float], factor: float) -> Any:
    """Return the values of a group as they are given, with the standard deviations of a grade beside them."""
    if given is not None and not isinstance(given, dict):
        return given  # a group that was built in Python, or something that will be refused
    values: dict[str, Any] = dict(given or {})
    for quantity, sigma in sigmas.items():
        value = values.get(quantity, {})
        if is_number(value):
            value = {"error": value}
        if isinstance(value, dict):
            values[quantity] = {"sigma": factor * sigma, **value}
    return values
