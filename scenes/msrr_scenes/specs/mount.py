"""Specifications of poses in space: of parts on a robot, and of the frames of a URDF."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import Field, model_validator

from msrr_scenes.geometry.frame_map import MappedFrame
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.spec import Angle, Coordinate, Spec

#: Name of a link of a URDF, or of a frame.
LinkName = Annotated[str, Field(min_length=1, max_length=255)]


class MountSpec(Spec):
    """A pose in space, turned by Rz(yaw) Ry(pitch) Rx(roll)."""

    x_m: Coordinate = 0.0
    """Place along x [m]."""
    y_m: Coordinate = 0.0
    """Place along y [m]."""
    z_m: Coordinate = 0.0
    """Place along z [m]."""
    roll_deg: Angle = 0.0
    """Angle about x [deg]."""
    pitch_deg: Angle = 0.0
    """Angle about y [deg]."""
    yaw_deg: Angle = 0.0
    """Angle about z [deg]."""

    @property
    def xyz(self) -> tuple[float, float, float]:
        """The place [m]."""
        return self.x_m, self.y_m, self.z_m

    @property
    def rpy(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw [rad]."""
        return math.radians(self.roll_deg), math.radians(self.pitch_deg), math.radians(self.yaw_deg)

    @property
    def X(self) -> SE3:
        """The pose."""
        return SE3.from_xyz_rpy(self.xyz, self.rpy)


class FrameSpec(MountSpec):
    """A frame of a unit: a link of its URDF, or a pose in one.

    A scene file may write the name of the link alone: ``camera: front_cam``.
    """

    link: LinkName
    """Link of the URDF; or, except for wheels, pins and holes, a frame that comes earlier in the map."""

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, value: Any) -> Any:
        return {"link": value} if isinstance(value, str) else value

    def mapped(self, name: str) -> MappedFrame:
        """Return the frame under the name that this project gives to it."""
        return MappedFrame(name, self.link, self.xyz, self.rpy)
