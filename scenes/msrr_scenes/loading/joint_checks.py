"""Checks of the joints of a robot, of which PyBullet takes not all that a URDF may have."""

from __future__ import annotations

from collections.abc import Iterator

from msrr_scenes.geometry.unit_geometry import UnitGeometry

#: Types of joints that PyBullet does not load without a ``<limit>``, and what they are meant to be instead.
_LIMITED = {"revolute": "continuous", "prismatic": "fixed"}


def joint_problems(geometry: UnitGeometry) -> Iterator[str]:
    """Yield what PyBullet cannot simulate of the joints of a unit, in words that name link and joint."""
    for link, joint in geometry.link_tree.joints.items():
        kind = joint.attrib["type"]
        where = f"link {geometry.name_in_urdf(link)!r}: joint {joint.get('name')!r} is {kind}"
        if kind == "floating":
            yield f"{where}, and PyBullet would hold it fast; make it a fixed one, or remove the link"
        elif kind in _LIMITED and joint.find("limit") is None:
            yield (
                f'{where} and has no <limit>; give it one with lower="..." and upper="...", or make it '
                f"{_LIMITED[kind]}"
            )
