"""The URDF of a unit as it was built: true places of tags, true wheels, true masses."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from xml.etree.ElementTree import Element, ElementTree

import numpy as np

from msrr_bullet.simulation.urdf_welding import joint_of
from msrr_scenes.arrays import Array
from msrr_scenes.as_built import BuiltDrive, BuiltUnit
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid, read_solid
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.geometry.urdf_tree import set_origin, urdf_origin

#: Distance that is kept between a tag and the box that it is fixed to [m].
_BEHIND_M = 0.0003

#: Edge below which a box is not cut any more [m].
_THINNEST_M = 0.0005

_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def build(
    tree: ElementTree[Element],
    drawn: UnitGeometry,
    built: BuiltUnit,
    plate_sizes: Mapping[str, float] = MappingProxyType({}),
) -> None:
    """Change a URDF, in place, to what was built; one that is as drawn is not touched.

    Args:
        tree: The URDF, not welded yet.
        drawn: Its geometry.
        built: The unit as it was built.
        plate_sizes: Edge of the plate of every tag that can be seen [m], by link.

    Raises:
        GeometryError: A wheel is not as drawn, and its shape has no radius that could be changed.
    """
    robot = tree.getroot()
    moved = [slot for slot in drawn.tag_slots if built.geometry.frame(slot) is not drawn.frame(slot)]
    for slot in moved:
        joint = joint_of(robot, slot)
        X_TX = drawn.frame(slot).inverse() @ built.geometry.frame(slot)
        set_origin(joint, urdf_origin(joint.find("origin")) @ X_TX)
        _give_way(robot, slot, drawn, built.geometry.frame(slot), 0.5 * plate_sizes.get(slot, 0.0))
    if not built.drive.ideal:
        _build_wheels(robot, drawn, built.drive)
    if built.mass_scale != 1.0:
        _scale_masses(robot, built.mass_scale)


def _give_way(robot: Element, slot: str, drawn: UnitGeometry, X_UX: SE3, half: float) -> None:
    """Set visible boxes and cylinders behind a tag back to where the tag is not inside them.

    A tag that was put on deeper than drawn is not inside the wall that carries it; the wall is deeper, too. A
    box is cut; one that is too thin, or a cylinder, moves. The plate in the link of the tag itself moves with
    the tag.

    Args:
        robot: Root of the URDF.
        slot: Link of the tag.
        drawn: Geometry of the URDF.
        X_UX: True pose of the tag.
        half: Half the edge of its plate [m].
    """
    X_TU, X_XU = drawn.frame(slot).inverse(), X_UX.inverse()
    for link in robot.findall("link"):
        name = link.attrib["name"]
        for visual in () if name in drawn.tag_slots else link.findall("visual"):
            shape = visual.find("geometry/*")
            if shape is None or shape.tag not in ("box", "cylinder"):
                continue
            solid = read_solid(name, drawn.frame(name), visual)
            points_U = solid.points()
            points_T = X_TU.act(points_U)
            lowest, highest = points_T.min(axis=0), points_T.max(axis=0)
            if lowest[2] < 0.0 or (lowest[:2] > half).any() or (highest[:2] < -half).any():
                continue  # it is not behind the tag as drawn
            missing = _BEHIND_M - float(X_XU.act(points_U)[:, 2].min())
            if missing > 0.0:
                moved_G = _set_back(shape, solid, X_UX.R[:, 2], missing)
                set_origin(visual, drawn.frame(name).inverse() @ solid.X_UG @ SE3(np.eye(3), moved_G))


def _set_back(shape: Element, solid: Solid, back_U: Array, missing: float) -> Array:
    """Cut a box on the side of a tag, and return by how much the middle of a shape moves in its frame [m].

    Args:
        shape: The shape in the URDF.
        solid: The same shape.
        back_U: Direction into the tag.
        missing: Distance that is missing between them [m].
    """
    back_G = solid.X_UG.R.T @ back_U
    if solid.kind != "box":
        return missing * back_G
    size, axis = np.array(solid.size), int(np.abs(back_G).argmax())
    cut = min(missing, max(size[axis] - _THINNEST_M, 0.0))
    size[axis] -= cut
    moved_G: Array = (missing - cut) * back_G
    moved_G[axis] += 0.5 * cut * np.sign(back_G[axis])
    shape.set("size", " ".join(repr(float(edge)) for edge in size))
    return moved_G


def _build_wheels(robot: Element, drawn: UnitGeometry, drive: BuiltDrive) -> None:
    """Give the wheels their true radius and track; the axle rises with a wheel, and the body stays level."""
    for side, scale in zip(("left", "right"), drive.radius_scale, strict=True):
        name = f"wheel_{side}"
        joint = joint_of(robot, name)
        p_U = drawn.frame(name).p
        shift_U = np.array([0.0, (drive.track_scale - 1.0) * p_U[1], (scale - 1.0) * drawn.wheel_radius])
        parent = joint.find("parent")
        assert parent is not None, "read_unit has checked that every joint has a parent"
        shift = drawn.frame(parent.attrib["link"]).R.T @ shift_U
        set_origin(joint, SE3(np.eye(3), shift) @ urdf_origin(joint.find("origin")))
        if scale != 1.0:
            _scale_radius(robot, drawn, name, scale)


def _scale_radius(robot: Element, drawn: UnitGeometry, name: str, scale: float) -> None:
    for link in robot.findall("link"):
        if link.attrib["name"] != name:
            continue
        if not [e for e in link.findall("collision/geometry/*") if "radius" in e.attrib]:
            raise GeometryError(
                f"{drawn.urdf}: the shape of link {name!r} has no radius, so as_built.drive cannot "
                "change it; make it a sphere or a cylinder"
            )
        for shape in (*link.findall("collision/geometry/*"), *link.findall("visual/geometry/*")):
            if "radius" in shape.attrib:
                shape.set("radius", repr(scale * float(shape.attrib["radius"])))


def _scale_masses(robot: Element, scale: float) -> None:
    for inertial in robot.findall("link/inertial"):
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        if mass is not None:
            mass.set("value", repr(scale * float(mass.attrib["value"])))
        for moment in _MOMENTS if inertia is not None else ():
            assert inertia is not None
            inertia.set(moment, repr(scale * float(inertia.get(moment, "0"))))
