"""Welding of a URDF for the physics engine: links behind fixed joints are merged.

PyBullet steps every link separately, even those behind fixed joints. A unit has some thirty links, most of
which only name a frame, and two units would take more than twice the time. The flag
``URDF_MERGE_FIXED_LINKS`` of PyBullet is no alternative: it gives all shapes of a merged body the friction
of one of them, and contacts can no longer be assigned to a pin.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np

from msrr_bullet.simulation.hull_margin import inset_meshes
from msrr_scenes.geometry.inertial import INERTIA, Inertial
from msrr_scenes.geometry.urdf_tree import carry_over, urdf_origin

_UPPER, _LOWER = np.triu_indices(3), np.tril_indices(3, -1)


def weld(tree: ElementTree[Element], separate: Collection[str]) -> None:
    """Merge links behind fixed joints into the links that carry them, in place.

    A link is merged if it has no collision shapes, or the same contact properties as the link that carries
    it. Mass, centre of mass and inertia of a merged link are those of the parts, and shapes stay where they
    are. A link without inertial data has no mass. Links form a tree
    (:func:`msrr_scenes.geometry.unit_geometry.read_unit` has checked it). Those that are ``separate`` are not
    merged, because contacts of each of them are queried.
    """
    robot = tree.getroot()
    links = {e.attrib["name"]: e for e in robot.findall("link")}
    joints = {_end(joint, "child").attrib["link"]: joint for joint in robot.findall("joint")}
    parents = {name: _end(joint, "parent") for name, joint in joints.items()}
    masses: dict[str, Inertial] = {}  # of links into which others have been merged
    # A carrier without shapes gets the contact properties of the first link merged into it: the largest one.
    order = sorted(joints, key=lambda name: -len(links[name].findall("collision")))
    for name in (*(n for n in order if links[n].find("collision") is None), *order):
        if name not in joints:
            continue
        joint, link = joints[name], links[name]
        up = parents[name].attrib["link"]
        carrier = links[up]
        if joint.get("type") != "fixed" or name in separate or not _may_join(link, carrier):
            continue
        carrier_mass = masses.get(up) or Inertial.of(carrier.find("inertial"))
        mass = masses.pop(name, None) or Inertial.of(link.find("inertial"))
        masses[up] = _joined(carrier_mass, mass.in_frame(urdf_origin(joint.find("origin"))))
        if link.find("collision") is not None and carrier.find("collision") is None:
            _copy_contact(carrier, link)
        for shape in (*link.findall("visual"), *link.findall("collision")):
            carry_over(shape, joint)
            carrier.append(shape)
        for child, parent in parents.items():
            if parent.attrib["link"] == name:
                parent.set("link", carrier.attrib["name"])
                carry_over(joints[child], joint)
        robot.remove(link)
        robot.remove(joint)
        del joints[name], parents[name]
    for name, mass in masses.items():
        _set_inertial(links[name], mass)


def write_welded(tree: ElementTree[Element], path: Path) -> None:
    """Write a URDF for PyBullet, with an element a line, and beside it the hulls of its collision meshes.

    PyBullet reads a line that is longer than 8 kB in pieces, and what stands where two meet comes apart: a
    mass of 12.5 was read as 12.0.
    """
    inset_meshes(tree, path.parent, path.stem)
    indent(tree)
    tree.write(path, encoding="utf-8", xml_declaration=True)


def _end(joint: Element, tag: str) -> Element:
    end = joint.find(tag)
    assert end is not None, "read_unit has checked that every joint has a parent and a child"
    return end


def _contact(link: Element) -> dict[str, str | None]:
    contact = link.find("contact")
    return {} if contact is None else {e.tag: e.get("value") for e in contact}


def _may_join(link: Element, carrier: Element) -> bool:
    one_without_shapes = link.find("collision") is None or carrier.find("collision") is None
    return one_without_shapes or _contact(link) == _contact(carrier)


def _copy_contact(carrier: Element, link: Element) -> None:
    for old in carrier.findall("contact"):
        carrier.remove(old)
    carrier.extend(link.findall("contact"))


def _joined(one: Inertial, other: Inertial) -> Inertial:
    total = one + other
    # As if it had been written and read again: a URDF has the upper triangle alone.
    total.inertia[_LOWER] = total.inertia.T[_LOWER]
    return total


def _set_inertial(link: Element, mass: Inertial) -> None:
    for old in link.findall("inertial"):
        link.remove(old)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=" ".join(map(repr, mass.centre.tolist())), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(mass.mass))
    upper = mass.inertia[_UPPER].tolist()
    SubElement(inertial, "inertia", dict(zip(INERTIA, map(repr, upper), strict=True)))


def joint_of(robot: Element, link: str) -> Element:
    """Return the joint that carries a link, given the root of a URDF that has one."""
    return next(joint for joint in robot.findall("joint") if _end(joint, "child").attrib["link"] == link)
