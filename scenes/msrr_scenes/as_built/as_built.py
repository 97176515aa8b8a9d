"""The parts of a trial as they were built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import IDEAL_LENS, Distortion
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry


@dataclass(frozen=True, eq=False)
class BuiltCamera:
    """A camera as it was built.

    Attributes:
        pinhole: True intrinsics.
        X_BX: Pose of the true frame of the camera's body (x along the optical axis) in that by calibration;
            None if they are the same.
        distortion: True distortion of the lens.
        clock_ahead_ns: Time that the clock of the camera is ahead of that of the computer.
        jitter_ns: Largest delay of a frame beyond the latency of the data sheet.
    """

    pinhole: PinholeCamera
    X_BX: SE3 | None = None
    distortion: Distortion = IDEAL_LENS
    clock_ahead_ns: int = 0
    jitter_ns: int = 0

    def stamp(self, now_ns: int) -> int:
        """Return the time that the clock of the camera shows at ``now_ns``; it shows no time before 0."""
        return max(now_ns + self.clock_ahead_ns, 0)

    def instant(self, stamp_ns: int) -> int:
        """Return when the clock of the camera shows ``stamp_ns``."""
        return stamp_ns - self.clock_ahead_ns

    def mounted(self, X_AB: SE3) -> SE3:
        """Return the true pose of the camera's body frame B in A, given the pose by calibration."""
        return X_AB if self.X_BX is None else X_AB @ self.X_BX

    def project(self, p_C: Array) -> Array:
        """Return the true pixels, shape (N, 2), of points in front of the camera, shape (N, 3) [m]."""
        shown = self.distortion.apply(p_C[:, :2] / p_C[:, 2:])
        return self.pinhole.project(np.column_stack([shown, np.ones(len(p_C))]))


@dataclass(frozen=True, slots=True, eq=False)
class BuiltTag:
    """The tag of an obstacle as it was put on.

    Attributes:
        X_TX: Pose of the true tag frame in the frame of the drawing; None if they are the same.
        print_scale: Size of the print over that of the drawing.
    """

    X_TX: SE3 | None = None
    print_scale: float = 1.0


@dataclass(frozen=True, slots=True)
class BuiltDrive:
    """The drive of a unit as it was built, seen from what the drive itself believes.

    Attributes:
        radius_scale: True over nominal radius of the left and the right wheel.
        track_scale: True over drawn distance between the wheels.
        lag_s: Time constant with which the speed of a motor follows its command [s].
        dead_zone_radps: Speed of a wheel below which the motor does not turn it [rad/s].
        backlash_rad: Play between motor and wheel [rad].
    """

    radius_scale: tuple[float, float] = (1.0, 1.0)
    track_scale: float = 1.0
    lag_s: float = 0.0
    dead_zone_radps: float = 0.0
    backlash_rad: float = 0.0

    @property
    def ideal(self) -> bool:
        """Whether the drive is as designed."""
        return self == BuiltDrive()


@dataclass(frozen=True, eq=False)
class BuiltUnit:
    """A unit as it was built.

    Attributes:
        geometry: Geometry with the true frames of the tags; all else is as designed.
        camera: Onboard camera.
        print_scale: Size of the printed tags over that of the drawing.
        drive: Drive.
        mass_scale: True over drawn mass of every part.
        switch_travel_error_m: True minus drawn travel of the seat switches of its ports [m].
    """

    geometry: UnitGeometry
    camera: BuiltCamera
    print_scale: float = 1.0
    drive: BuiltDrive = BuiltDrive()
    mass_scale: float = 1.0
    switch_travel_error_m: float = 0.0


@dataclass(frozen=True, slots=True)
class BuiltFloor:
    """The floor as it was built.

    Attributes:
        friction_scale: True over nominal friction.
        slope: Slope along x and along y of the world, positive where the floor rises [rad].
        ridge_m: Height of the ridges at the joints of the floor [m].
        first_joint: Place of one joint along x and of one along y of the world [m].
    """

    friction_scale: float = 1.0
    slope: tuple[float, float] = (0.0, 0.0)
    ridge_m: float = 0.0
    first_joint: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class AsBuilt:
    """The truth of a trial about everything that was built.

    Attributes:
        units: Every unit, by name.
        overhead: Overhead camera; None without one.
        obstacle_tags: Tag of every obstacle that carries one, by name of the obstacle.
        floor: Floor.
        errors: Every error that was given or drawn, in the unit of its quantity, by the name of its stream.
    """

    units: Mapping[str, BuiltUnit]
    overhead: BuiltCamera | None = None
    obstacle_tags: Mapping[str, BuiltTag] = field(default_factory=dict)
    floor: BuiltFloor = BuiltFloor()
    errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def is_as_designed(self) -> bool:
        """Whether nothing differs from the drawing, faults of the scene included."""
        return not self.errors and all(unit.camera.X_BX is None for unit in self.units.values())
