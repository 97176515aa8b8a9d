"""The copy of a unit's URDF that the physics engine loads: rigid pieces welded, frames without shapes gone.

PyBullet steps every link of a body as a link of its own, fixed joints included; a unit has some thirty, most
of which only name a frame, and two units would cost more than twice as much as they have to. PyBullet's own
``URDF_MERGE_FIXED_LINKS`` goes too far: it gives all shapes of a rigid piece the friction of one of them,
and forgets which of them is a pin.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, parse

import numpy as np
from scipy.spatial.transform import Rotation

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import urdf_origin

_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_urdf(path: Path) -> ElementTree[Element]:
    """Read a URDF so that a copy of it may lie elsewhere: what it names beside itself is named in full."""
    tree = parse(path)
    for element in tree.iter():
        if element.tag in ("mesh", "texture") and "filename" in element.attrib:
            element.set("filename", str((path.parent / element.attrib["filename"]).resolve()))
    return tree


def weld(tree: ElementTree[Element], apart: Collection[str]) -> None:
    """Merge links behind fixed joints into the links that carry them, in place.

    A link is merged if its contacts do not need it: it has no collision shapes, or the same contact
    properties as the shapes that it joins. Mass, centre of mass and inertia of the whole are those of its
    parts, shapes stay where they are. A link without inertial data weighs nothing when it is merged.

    Args:
        tree: A URDF whose links form a tree (:func:`msrr_scenes.geometry.unit_geometry.read_unit` has
            checked it).
        apart: Links that stay links of their own, because somebody asks the engine about their contacts.
    """
    robot = tree.getroot()
    links = {e.attrib["name"]: e for e in robot.findall("link")}
    joints = {_end(joint, "child").attrib["link"]: joint for joint in robot.findall("joint")}
    # A carrier without shapes takes the contact properties of the first that joins it: of the largest part.
    order = sorted(joints, key=lambda name: -len(links[name].findall("collision")))
    for name in (*(n for n in order if links[n].find("collision") is None), *order):
        if name not in joints:
            continue
        joint, link = joints[name], links[name]
        carrier = links[_end(joint, "parent").attrib["link"]]
        if joint.get("type") != "fixed" or name in apart or not _may_join(link, carrier):
            continue
        X_CL = urdf_origin(joint.find("origin"))
        _add_mass(carrier, link, X_CL)
        if link.find("collision") is not None and carrier.find("collision") is None:
            _take_contact(carrier, link)
        for shape in (*link.findall("visual"), *link.findall("collision")):
            _set_origin(shape, X_CL @ urdf_origin(shape.find("origin")))
            carrier.append(shape)
        for other in joints.values():
            parent = _end(other, "parent")
            if parent.attrib["link"] == name:
                parent.set("link", carrier.attrib["name"])
                _set_origin(other, X_CL @ urdf_origin(other.find("origin")))
        robot.remove(link)
        robot.remove(joint)
        del joints[name]


def _end(joint: Element, tag: str) -> Element:
    end = joint.find(tag)
    assert end is not None, "read_unit refuses joints without ends"
    return end


def _contact(link: Element) -> dict[str, str | None]:
    contact = link.find("contact")
    return {} if contact is None else {e.tag: e.get("value") for e in contact}


def _may_join(link: Element, carrier: Element) -> bool:
    either_untouchable = link.find("collision") is None or carrier.find("collision") is None
    return either_untouchable or _contact(link) == _contact(carrier)


def _take_contact(carrier: Element, link: Element) -> None:
    for old in carrier.findall("contact"):
        carrier.remove(old)
    carrier.extend(link.findall("contact"))


@dataclass(frozen=True, eq=False)
class _Mass:
    """Mass [kg], centre (3,) [m] and inertia (3, 3) about the centre [kg m^2], in a link's frame."""

    mass: float
    centre: Array
    inertia: Array

    @classmethod
    def of(cls, inertial: Element | None) -> _Mass:
        if inertial is None:
            return cls(0.0, np.zeros(3), np.zeros((3, 3)))
        X_LI = urdf_origin(inertial.find("origin"))
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        m = 0.0 if mass is None else float(mass.attrib["value"])
        xx, xy, xz, yy, yz, zz = (
            0.0 if inertia is None else float(inertia.get(name, "0")) for name in _INERTIA
        )
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return cls(m, X_LI.p, X_LI.R @ J @ X_LI.R.T)

    def seen_from(self, X_CL: SE3) -> _Mass:
        return _Mass(self.mass, X_CL.act(self.centre), X_CL.R @ self.inertia @ X_CL.R.T)

    def about(self, point: Array) -> Array:
        """Inertia about another point, by the parallel axis theorem."""
        d = self.centre - point
        shifted: Array = self.inertia + self.mass * (d @ d * np.eye(3) - np.outer(d, d))
        return shifted

    def __add__(self, other: _Mass) -> _Mass:
        mass = self.mass + other.mass
        if mass == 0.0:
            return self
        centre = (self.mass * self.centre + other.mass * other.centre) / mass
        return _Mass(mass, centre, self.about(centre) + other.about(centre))


def _add_mass(carrier: Element, link: Element, X_CL: SE3) -> None:
    inertial = carrier.find("inertial")
    whole = _Mass.of(inertial) + _Mass.of(link.find("inertial")).seen_from(X_CL)
    if inertial is not None:
        carrier.remove(inertial)
    inertial = SubElement(carrier, "inertial")
    SubElement(inertial, "origin", xyz=_numbers(whole.centre), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(float(whole.mass)))
    upper = whole.inertia[np.triu_indices(3)]
    SubElement(inertial, "inertia", {name: repr(float(j)) for name, j in zip(_INERTIA, upper, strict=True)})


def _set_origin(element: Element, X: SE3) -> None:
    for old in element.findall("origin"):
        element.remove(old)
    with warnings.catch_warnings():
        # Pitched by a right angle a rotation has many such triples; any of them will do.
        warnings.simplefilter("ignore", UserWarning)
        roll_pitch_yaw = Rotation.from_matrix(X.R).as_euler("xyz")
    element.insert(0, Element("origin", xyz=_numbers(X.p), rpy=_numbers(roll_pitch_yaw)))


def _numbers(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)
