"""URDFs that are made of others or of a map of tags, for a robot and a target outside of the simulator."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import FIXTURE, X_PD, read_unit
from msrr_scenes.geometry.urdf_file import read_drawn_urdf
from msrr_scenes.geometry.urdf_tree import set_origin

#: Thickness of the plates of a fixture's tags [m], and their edge over that of the black square.
_PLATE_M, _PLATE_RATIO = 0.002, 1.25


def with_camera(urdf: Path, X_UC: SE3) -> str:
    """Return the URDF of a unit with its camera mounted elsewhere; the rest of it stays as designed.

    C is the frame of the camera's link: x along the optical axis, z up in the image.

    Raises:
        GeometryError: The file is no URDF of a unit.
    """
    unit = read_unit(urdf)
    root = read_drawn_urdf(urdf).getroot()
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None and child.get("link") == "camera":
            set_origin(joint, unit.frame(parent.attrib["link"]).inverse() @ X_UC)
    return ElementTree.tostring(root, encoding="unicode")


def fixture_urdf(port: str, X_DT: Mapping[int, SE3], size: float) -> str:
    """Return the URDF of a fixture: a body that carries the tags of one port and does not drive.

    ``X_DT`` has the pose of every tag by id, and ``size`` is the edge of the black square of the tags [m].
    The frame U of the fixture is the dock frame D of the port.
    """
    root = Element("robot", name="fixture", kind=FIXTURE)
    SubElement(root, "link", name="axle")
    _add_link(root, f"port_{port}", SE3.from_se2(X_PD.inverse()))
    for tag, X in X_DT.items():
        link = _add_link(root, marker_slot(port, tag), X)
        collision = SubElement(link, "collision")
        set_origin(collision, SE3.from_xyz_rpy([0.0, 0.0, 0.5 * _PLATE_M], [0.0, 0.0, 0.0]))
        edge = _PLATE_RATIO * size
        SubElement(SubElement(collision, "geometry"), "box", size=f"{edge!r} {edge!r} {_PLATE_M!r}")
    return ElementTree.tostring(root, encoding="unicode")


def marker_slot(port: str, tag: int) -> str:
    """Return the link that carries a tag of the port of a fixture."""
    return f"port_{port}_marker_{tag}"


def _add_link(root: Element, name: str, X_UL: SE3) -> Element:
    link = SubElement(root, "link", name=name)
    joint = SubElement(root, "joint", name=f"{name}_joint", type="fixed")
    SubElement(joint, "parent", link="axle")
    SubElement(joint, "child", link=name)
    set_origin(joint, X_UL)
    return link
