"""The joints of a URDF: those that are malformed, on which PyBullet ends the process, and unit axes."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from msrr_scenes.errors import GeometryError, nearest
from msrr_scenes.geometry.urdf_tree import one_number, urdf_origin, xyz_of

_TYPES = ("fixed", "continuous", "revolute", "prismatic", "planar", "spherical", "floating")

#: Numbers about a joint that moves, by the element that holds them.
_NUMBERS = {"limit": ("lower", "upper", "effort", "velocity"), "dynamics": ("damping", "friction")}

#: Largest deviation of the length of a unit vector from 1 by the rounding of its numbers.
_ROUNDING = 1e-9


def check_joints(path: Path, root: Element) -> None:
    """Refuse joints that are malformed, before a frame map adds links.

    Raises:
        GeometryError: There is one; the message names it, and the link that it carries.
    """
    links = [link.get("name", "") for link in root.findall("link")]
    names = [joint.get("name") for joint in root.findall("joint")]
    for joint in root.findall("joint"):
        for end in (*joint.findall("parent"), *joint.findall("child")):
            link = end.get("link", "")
            if link not in links:
                raise GeometryError(
                    f"{path}: joint {joint.get('name')!r} names the link {link!r} as its {end.tag}, which is "
                    f"not in the file{nearest(link, links)} Links: {', '.join(links)}"
                )
        child, name = joint.find("child"), joint.get("name")
        where = f"{path}: link {None if child is None else child.get('link')!r}"
        if not name:
            raise GeometryError(f"{where}: the joint that carries it has no name; give it one")
        if names.count(name) > 1:
            raise GeometryError(f"{where}: another joint is called {name!r} as well; rename one of them")
        try:
            urdf_origin(joint.find("origin"))
            _check_motion(joint)
        except GeometryError as error:
            raise GeometryError(f"{where}: joint {name!r}: {error}") from None


def joint_axis(joint: Element) -> Element:
    """Return the ``<axis>`` of a joint; one that has none gets that which a URDF means then, x."""
    axis = joint.find("axis")
    return SubElement(joint, "axis", xyz="1 0 0") if axis is None else axis


def write_unit_axes(root: Element) -> None:
    """Make the axes of all joints that move unit vectors, in place.

    PyBullet takes them as they are: about an axis of length 2 a motor turns a wheel twice as fast.
    """
    for joint in root.findall("joint"):
        if joint.get("type") != "fixed":
            axis = joint_axis(joint)
            xyz = xyz_of(axis)
            length = float(np.linalg.norm(xyz))
            if abs(length - 1.0) > _ROUNDING:
                axis.set("xyz", " ".join(map(repr, (xyz / length).tolist())))


def _check_motion(joint: Element) -> None:
    """Refuse a joint whose type, axis, limits or losses are not what a URDF has there."""
    kind = joint.get("type")
    if kind not in _TYPES:
        found = "it has no type." if kind is None else f"unknown type {kind!r}{nearest(kind, _TYPES)}"
        raise GeometryError(f"{found} Types: {', '.join(_TYPES)}")
    if kind == "fixed":
        return
    axis = joint.find("axis")
    if axis is not None and not xyz_of(axis).any():
        raise GeometryError("its <axis> has no direction")
    for tag, keys in _NUMBERS.items():
        for element in joint.findall(tag):
            for key in keys:
                one_number(element, key)
    for dynamics in joint.findall("dynamics"):
        if not any(key in dynamics.attrib for key in _NUMBERS["dynamics"]):
            raise GeometryError("its <dynamics> has neither damping nor friction; remove it")
        if one_number(dynamics, "damping") < 0.0:
            raise GeometryError(
                f"its damping has to be 0 or above, found {dynamics.get('damping')!r}; less would drive it"
            )
