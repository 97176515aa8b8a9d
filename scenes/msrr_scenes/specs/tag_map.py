"""A map of tags that was measured from pictures, as its file says it."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, field_validator

from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.spec import Coordinate, FileName, Size, Spec, between

#: Largest deviation of the length of a quaternion from one: files round.
_UNIT_TOLERANCE = 1e-3

_Component = Annotated[float, between(-1.0, 1.0)]
_Cofactor = Annotated[float, between(-1e6, 1e6)]


class MappedTagSpec(Spec):
    """Pose of a tag in the map."""

    position_m: tuple[Coordinate, Coordinate, Coordinate]
    """Place of the middle of the tag [m]."""
    quaternion_xyzw: tuple[_Component, _Component, _Component, _Component]
    """Rotation of the tag's frame: x right, y down, z into the tag."""
    covariance: tuple[_Cofactor, ...] = Field(default=(0.0,) * 36, min_length=36, max_length=36)
    """Covariance of place [m] and rotation about the map's axes [rad], row by row, as ROS orders it."""
    pictures: int = Field(default=1, ge=1, le=1_000_000)
    """Number of pictures that tell of it."""

    @field_validator("quaternion_xyzw")
    @classmethod
    def _has_length_one(cls, xyzw: tuple[float, ...]) -> tuple[float, ...]:
        if abs(math.hypot(*xyzw) - 1.0) > _UNIT_TOLERANCE:
            raise ValueError("expected a quaternion of length 1")
        return xyzw

    @property
    def X_MT(self) -> SE3:
        """The pose in the map."""
        return SE3.from_quaternion_xyzw(self.position_m, self.quaternion_xyzw)


class TagMapSpec(Spec):
    """Tags in the frame of one of them, which is the map's."""

    family: FileName
    """Tag family."""
    tag_size_m: Size
    """Edge of the black square of every tag [m]."""
    reference: int = Field(ge=0, le=1_000_000)
    """Id of the tag whose frame is the map's."""
    tags: dict[Annotated[int, Field(ge=0, le=1_000_000)], MappedTagSpec] = Field(max_length=100_000)
    """The tags by their ids."""
