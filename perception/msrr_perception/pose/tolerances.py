"""Tolerances of a docking pair's calibration: how far what was built may be from what a robot is told."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from msrr_perception.kernels.calibrated import (
    BORDER,
    CAMERA,
    CENTRE,
    CLOCK,
    EDGE,
    FOCAL,
    K1,
    PARAMETERS,
    PRINT,
    TAG,
)
from msrr_perception.pose.marker_mounts import MOUNT_SIZE
from msrr_scenes.arrays import Array
from msrr_scenes.specs.as_built import AsBuiltSpec, MountDeviations

#: Standard deviation of the distance by which all edges of tags look farther out than they are [px]; no
#: drawing has it.
_EDGE_PX = 0.005


def mount_sigmas(group: MountDeviations) -> tuple[float, ...]:
    """Return the standard deviations of a mount: x, y, z [m], roll, pitch, yaw [rad]."""
    places = (group.x_m.sigma, group.y_m.sigma, group.z_m.sigma)
    angles = (group.roll_deg.sigma, group.pitch_deg.sigma, group.yaw_deg.sigma)
    return places + tuple(math.radians(angle) for angle in angles)


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Standard deviations of the errors of calibration of a docking pair.

    Attributes:
        camera: Mount of the camera: x, y, z [m], roll, pitch, yaw [rad], x along the optical axis and z up.
        focal: Relative error of the focal length.
        centre: Principal point, column and row [px].
        k1: Coefficient of the radial distortion.
        clock_s: Time by which the camera's clock is ahead [s].
        printed: Relative error of the size of the tags, which all come from one printer.
        bracket: Mount of the marker of a port, as ``camera``, in the dock frame.
        tag: Mount of every tag, as ``camera``, in its own frame.
        wheels: Relative errors of the radii of the left and the right wheel, and of the track.
        backlash: Play of the gear of a wheel [rad].
    """

    camera: tuple[float, ...] = (0.0,) * 6
    focal: float = 0.0
    centre: tuple[float, float] = (0.0, 0.0)
    k1: float = 0.0
    clock_s: float = 0.0
    printed: float = 0.0
    bracket: tuple[float, ...] = (0.0,) * 6
    tag: tuple[float, ...] = (0.0,) * 6
    wheels: tuple[float, float, float] = (0.0, 0.0, 0.0)
    backlash: float = 0.0

    @classmethod
    def from_spec(cls, spec: AsBuiltSpec) -> Tolerances:
        """Take the tolerances that a robot is told; true errors are not looked at."""
        camera, drive = spec.onboard, spec.drive
        return cls(
            camera=mount_sigmas(camera),
            focal=0.01 * camera.focal_percent.sigma,
            centre=(camera.cx_px.sigma, camera.cy_px.sigma),
            k1=camera.k1.sigma,
            clock_s=1e-3 * camera.clock_ms.sigma,
            printed=0.01 * spec.tags.print_percent.sigma,
            bracket=mount_sigmas(spec.bracket),
            tag=mount_sigmas(spec.tags),
            wheels=(
                0.01 * drive.radius_left_percent.sigma,
                0.01 * drive.radius_right_percent.sigma,
                0.01 * drive.track_percent.sigma,
            ),
            backlash=math.radians(drive.backlash_deg.sigma),
        )

    def sigmas(self) -> Array:
        """Return the standard deviations of all parameters on which the image of a tag depends."""
        out = np.zeros(PARAMETERS)
        out[CAMERA : CAMERA + 6], out[FOCAL], out[CENTRE : CENTRE + 2] = self.camera, self.focal, self.centre
        out[K1], out[CLOCK], out[EDGE], out[PRINT] = self.k1, self.clock_s, _EDGE_PX, self.printed
        out[TAG : TAG + MOUNT_SIZE] = self.tag
        out[BORDER:] = 1.0
        return out
