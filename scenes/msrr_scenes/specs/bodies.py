"""Specifications of the bodies in the arena, units and obstacles, and of the tags on them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from msrr_scenes.specs.spec import Coordinate, FileName, Name, PoseSpec, Size, Spec, Time
from msrr_scenes.specs.tag_families import FAMILIES, TAG36H11, FamilyName, TagFamily
from msrr_scenes.specs.tag_map import TagMapSpec

TAGS_PER_UNIT = 10

#: Number of units for which the default tag family has ids.
MAX_UNITS = 50

#: Number of tags of the largest family; whether the family of a scene has an id is checked with the scene.
MOST_TAGS = max(family.ids for family in FAMILIES.values())

TagId = Annotated[int, Field(ge=0, lt=MOST_TAGS)]

#: Height of the face of an obstacle's tag above the lid [m]: the thickness of the plate that carries the tag.
TAG_PLATE_M = 0.002


class ArenaSpec(Spec):
    """The rectangle of floor that no body may leave."""

    x_m: tuple[Coordinate, Coordinate] = (-2.0, 2.0)
    """Lowest and highest x of the floor in the world frame [m]."""
    y_m: tuple[Coordinate, Coordinate] = (-1.5, 1.5)
    """Lowest and highest y of the floor in the world frame [m]."""


class TagsSpec(Spec):
    """Family and sizes of the AprilTags on the units; a size is the edge of the black square.

    Prints of all families are of one size, so that they fit the unit, unless sizes are given.
    """

    family: FamilyName = "tag36h11"
    """AprilTag family of every tag, those on obstacles included."""
    top_m: Size = 0.12
    """Edge of the tag on top of a unit [m]."""
    side_m: Size = 0.05
    """Edge of the left and the right tag of a port [m]."""
    mast_m: Size = 0.04
    """Edge of the middle tag of a port, on the mast [m]."""

    @model_validator(mode="before")
    @classmethod
    def _prints_of_one_size(cls, values: Any) -> Any:
        """Fill in the sizes that are not given, of a family that is not the default one."""
        family = values.get("family") if isinstance(values, dict) else None
        if not isinstance(family, str) or family not in FAMILIES or family == TAG36H11.name:
            return values
        share = TAG36H11.plate_ratio / FAMILIES[family].plate_ratio
        sizes = {key: share * cls.model_fields[key].default for key in ("top_m", "side_m", "mast_m")}
        return {**sizes, **values}

    @property
    def tag_family(self) -> TagFamily:
        """What is known of the family."""
        return FAMILIES[self.family]

    def size(self, slot: str) -> float:
        """Return the edge [m] of the black square of the tag on link ``slot``."""
        if slot == "tag_top":
            return self.top_m
        return self.mast_m if slot.endswith("_middle") else self.side_m


class MarkerSpec(Spec):
    """The marker of a port as it was measured, in the place of its drawing.

    A scene file may write the name of the map's file alone: ``rear: marker.yaml``.
    """

    map: TagMapSpec
    """Map of its three tags, as ``msrr map`` writes it; a scene file names the file, relative to its own
    folder."""
    anchor: Literal["left", "middle", "right"] = "middle"
    """Tag of the marker that is where the URDF has it, so that it says where the map is on the unit."""


class UnitSpec(Spec):
    """One unit."""

    number: int = Field(ge=0, le=49)
    """Number n of the unit: tag 10 n is on top, tags 10 n + 1 .. 10 n + 9 are on the ports."""
    urdf: FileName = "unit.urdf"
    """File name of the URDF: beside the scene file, in the working folder, or a shipped one."""
    pose: PoseSpec = PoseSpec()
    """Start pose."""
    tag_ids: dict[str, TagId] = Field(default_factory=dict, max_length=MOST_TAGS)
    """Tag ids that differ from those of the number, by link name."""
    markers: dict[Name, MarkerSpec] = Field(default_factory=dict, max_length=TAGS_PER_UNIT)
    """Markers of ports whose tags are where a map has them instead of the URDF, by port; everybody knows."""


class _Obstacle(Spec):
    height_m: Size = 0.15
    """Height of the obstacle [m]."""
    pose: PoseSpec = PoseSpec()
    """Start pose of the middle of the base."""
    tag_id: TagId | None = None
    """Id of the tag on the lid; without one the overhead camera cannot find the obstacle."""
    tag_m: Size = 0.10
    """Edge of the black square of the tag on the lid [m]."""
    appears_at_s: Time = 0.0
    """Time at which the obstacle appears [s]."""


class CylinderSpec(_Obstacle):
    """An upright cylinder, fixed to the floor."""

    shape: Literal["cylinder"]
    """Kind of obstacle."""
    radius_m: Size
    """Radius of the cylinder [m]."""


class BoxSpec(_Obstacle):
    """A box, fixed to the floor."""

    shape: Literal["box"]
    """Kind of obstacle."""
    length_m: Size
    """Edge along x of the box [m]."""
    width_m: Size
    """Edge along y of the box [m]."""

    @property
    def radius_m(self) -> float:
        """Radius of the circle about the footprint [m]."""
        return 0.5 * float((self.length_m**2 + self.width_m**2) ** 0.5)


ObstacleSpec = Annotated[CylinderSpec | BoxSpec, Field(discriminator="shape")]
