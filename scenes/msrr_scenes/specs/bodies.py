"""Specifications of the things that stand in the arena: units and obstacles."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from msrr_scenes.specs.spec import PoseSpec, Positive, Spec

TAGS_PER_UNIT = 10
FIRST_OBSTACLE_TAG = 500

#: How far the face of an obstacle's tag lies above its lid [m]: the plate that carries it is not nothing.
TAG_PLATE_M = 0.002


class UnitSpec(Spec):
    """One unit: its number gives its tag ids (10 n for the top tag, 10 n + 1 .. 10 n + 9 for the ports)."""

    number: int = Field(ge=0, le=49)
    urdf: str = "unit.urdf"
    pose: PoseSpec = PoseSpec()
    tag_ids: dict[str, int] = Field(default_factory=dict, description="overrides: link name -> tag id")


class _Obstacle(Spec):
    height_m: Positive = 0.15
    pose: PoseSpec = PoseSpec()
    tag_id: Annotated[int, Field(ge=0, le=586)] | None = None
    tag_m: Positive = 0.10
    appears_at_s: float = Field(default=0.0, ge=0.0)


class CylinderSpec(_Obstacle):
    """An upright cylinder, fixed to the floor."""

    shape: Literal["cylinder"]
    radius_m: Positive


class BoxSpec(_Obstacle):
    """A box, fixed to the floor."""

    shape: Literal["box"]
    length_m: Positive
    width_m: Positive

    @property
    def radius_m(self) -> float:
        """Radius of the circle about the footprint [m]."""
        return 0.5 * float((self.length_m**2 + self.width_m**2) ** 0.5)


ObstacleSpec = Annotated[CylinderSpec | BoxSpec, Field(discriminator="shape")]
