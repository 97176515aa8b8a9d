"""The families of AprilTags that a scene may name, as the AprilTag library prints and reads them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

FamilyName = Literal[
    "tag16h5",
    "tag25h9",
    "tag36h11",
    "tagCircle21h7",
    "tagCircle49h12",
    "tagCustom48h12",
    "tagStandard41h12",
    "tagStandard52h13",
]


@dataclass(frozen=True, slots=True)
class TagFamily:
    """A family of tags.

    Attributes:
        name: Name of the family in the AprilTag library.
        ids: Number of its tags; their ids are 0 .. ids - 1.
        edge_modules: Modules (bits) along the edge of the square whose corners are detected: where the black
            frame of a tag meets its white one. The size of a tag is the length of this edge.
        plate_modules: Modules along the edge of the whole print.
        distance: Number of bits in which two tags differ at least.
        white_inside: Whether the white frame lies inside the black one; the outermost bits lie around both.
    """

    name: FamilyName
    ids: int
    edge_modules: int
    plate_modules: int
    distance: int
    white_inside: bool

    @property
    def plate_ratio(self) -> float:
        """Edge of the print over the size of the tag."""
        return self.plate_modules / self.edge_modules

    @property
    def corrected_bits(self) -> int:
        """Number of bits that a detector may correct: none where codes are so near that noise is a tag."""
        return 0 if self.distance < 9 else 1


#: Families by name. A test compares them with the library.
FAMILIES: Mapping[str, TagFamily] = MappingProxyType(
    {
        family.name: family
        for family in (
            TagFamily("tag16h5", 30, 6, 8, 5, False),
            TagFamily("tag25h9", 35, 7, 9, 9, False),
            TagFamily("tag36h11", 587, 8, 10, 11, False),
            TagFamily("tagCircle21h7", 38, 5, 9, 7, True),
            TagFamily("tagCircle49h12", 65535, 5, 11, 12, True),
            TagFamily("tagCustom48h12", 42211, 6, 10, 12, True),
            TagFamily("tagStandard41h12", 2115, 5, 9, 12, True),
            TagFamily("tagStandard52h13", 48714, 6, 10, 13, True),
        )
    }
)

#: The family of tags unless a scene names another.
TAG36H11 = FAMILIES["tag36h11"]
