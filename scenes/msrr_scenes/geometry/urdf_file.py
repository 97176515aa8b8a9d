"""Reading of a URDF: its files, its links by the names that this project uses, the turn of its wheels."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, ParseError, parse

import numpy as np

from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.frame_map import FrameMap, apply_frame_map
from msrr_scenes.geometry.urdf_joints import check_joints, joint_axis, write_unit_axes
from msrr_scenes.geometry.urdf_tree import LinkTree, xyz_of

_WHEELS = ("wheel_left", "wheel_right")

_PACKAGE_SCHEME = "package://"
_XACRO = re.compile(r"\{[^}]*xacro[^}]*\}")

#: Largest deviation of the direction of an axis from that of the drawing [rad].
_ALONG = 1e-3


@dataclass(frozen=True, slots=True)
class WheelJoint:
    """The joint of a wheel: ``forward`` is 1.0 if a positive angle turns it forward, and -1.0 if backward."""

    name: str
    forward: float


def read_urdf(path: Path, frames: FrameMap = ()) -> ElementTree[Element]:
    """Read a URDF: file names absolute, links by the names of this project, wheels turning forward.

    Axes of joints are unit vectors. In the map a frame follows those that it refers to.

    Raises:
        GeometryError: The file is missing or is no URDF, or a joint names a link that is not in it.
        FrameMapError: A frame is not one of a unit, or its link is not in the URDF.
    """
    tree = read_drawn_urdf(path, frames)
    links = LinkTree(path, tree.getroot())
    write_unit_axes(tree.getroot())
    if {"axle", *_WHEELS} <= links.links.keys():
        for name in _WHEELS:
            axis, forward = _wheel_axis(links, name)
            if forward < 0.0:
                axis.set("xyz", " ".join(repr(float(a)) for a in -xyz_of(axis)))
    return tree


def read_wheel_joints(path: Path, frames: FrameMap) -> tuple[WheelJoint, WheelJoint]:
    """Return the joints of the left and the right wheel of a unit, as its URDF has them.

    Raises:
        GeometryError: As in :func:`read_urdf`.
        FrameMapError: As in :func:`read_urdf`.
    """
    links = LinkTree(path, read_drawn_urdf(path, frames).getroot())
    left, right = (
        WheelJoint(links.joints[name].attrib["name"], _wheel_axis(links, name)[1]) for name in _WHEELS
    )
    return left, right


def read_drawn_urdf(path: Path, frames: FrameMap = ()) -> ElementTree[Element]:
    """Read a URDF as :func:`read_urdf` does, but its joints have the axes that are drawn.

    Raises:
        GeometryError: As in :func:`read_urdf`.
        FrameMapError: As in :func:`read_urdf`.
    """
    try:
        tree = parse(path)
    except FileNotFoundError:
        raise GeometryError(f"{path}: no such URDF file") from None
    except (ParseError, LookupError, ValueError) as error:  # the last two of an encoding
        raise GeometryError(f"{path}: not well-formed XML: {error}") from None
    for element in tree.iter():
        if _XACRO.match(element.tag):
            raise GeometryError(f"{path}: holds macros; expand them first: xacro {path.name} > robot.urdf")
    root = tree.getroot()
    for element in elements_with_files(root):
        element.set("filename", str(named_file(path, element.attrib["filename"])))
    _check_names(path, root)
    check_joints(path, root)
    _check_one_tree(path, root)
    if frames:
        apply_frame_map(path, root, frames)
    return tree


def elements_with_files(root: Element) -> Iterator[Element]:
    """Yield the elements of a URDF that name its files, meshes and textures; a plugin is of no use here."""
    return (e for e in root.iter() if e.tag in ("mesh", "texture") and "filename" in e.attrib)


def named_file(urdf: Path, name: str) -> Path:
    """Return the path of a file that a URDF names, beside itself or as ROS does, by a package.

    Raises:
        GeometryError: The URDF is in no folder of the name of the package.
    """
    if not name.startswith(_PACKAGE_SCHEME):
        return (urdf.parent / name.removeprefix("file://")).absolute()
    package, _, rest = name.removeprefix(_PACKAGE_SCHEME).partition("/")
    for folder in urdf.absolute().parents:
        if folder.name == package:
            return folder / rest
    raise GeometryError(
        f"{urdf}: {name}: the URDF is in no folder {package!r}; put it back there, or write the path from "
        "the URDF to the file"
    )


def _check_names(path: Path, root: Element) -> None:
    """Refuse a robot or a material without a name, of which PyBullet loads nothing."""
    if root.tag == "robot" and "name" not in root.attrib:
        raise GeometryError(f'{path}: the <robot> has no name; give it one: <robot name="...">')
    holders = [("the <robot>", root.findall("material"))]
    holders += [
        (f"link {link.get('name')!r}", link.findall("visual/material")) for link in root.findall("link")
    ]
    for holder, materials in holders:
        if any("name" not in material.attrib for material in materials):
            raise GeometryError(
                f'{path}: {holder}: a <material> has no name; give it one: <material name="...">'
            )


def _check_one_tree(path: Path, root: Element) -> None:
    """Refuse links that are not one tree, on which PyBullet ends the process.

    Raises:
        GeometryError: Two links have one name, a link hangs on two joints, or on none beside the root link,
            or links hang on each other in a circle.
    """
    links = [link.get("name", "") for link in root.findall("link")]
    children = [child.get("link", "") for child in root.findall("joint/child")]
    twice = next((name for name in links if links.count(name) > 1), None)
    if twice is not None:
        raise GeometryError(f"{path}: two links are called {twice!r}; rename or remove one of them")
    hung = next((name for name in children if children.count(name) > 1), None)
    if hung is not None:
        joints = [
            repr(j.get("name")) for j in root.findall("joint") for c in j.findall(f"child[@link='{hung}']")
        ]
        raise GeometryError(
            f"{path}: the joints {' and '.join(joints)} both carry the link {hung!r}; remove one"
        )
    roots = [name for name in links if name not in children]
    if len(roots) > 1:
        raise GeometryError(
            f"{path}: no joint carries {', '.join(map(repr, roots))}, and a robot has one such link, its "
            "root; join the others to it, or remove them"
        )
    _check_no_circle(path, root)


def _check_no_circle(path: Path, root: Element) -> None:
    """Refuse links that carry each other in a circle, which no other link carries."""
    above = {
        child.get("link", ""): (parent.get("link", ""), joint.get("name", ""))
        for joint in root.findall("joint")
        for parent in joint.findall("parent")
        for child in joint.findall("child")
    }
    for first in above:
        circle = [first]
        while (carrier := above.get(circle[-1], ("", ""))[0]) and carrier not in circle:
            circle.append(carrier)
        if carrier == first:
            joints = ", ".join(repr(above[link][1]) for link in circle)
            raise GeometryError(
                f"{path}: the links {', '.join(map(repr, circle))} carry each other in a circle, by the "
                f"joints {joints}, and a robot has one link that no joint carries, its root; remove one of "
                "these joints"
            )


def _wheel_axis(tree: LinkTree, wheel: str) -> tuple[Element, float]:
    """Return the axis of a wheel's joint, and which way a positive angle turns the wheel.

    That is 1.0, forward, if the axis points to the left, and -1.0, backward, if to the right.

    Raises:
        GeometryError: The wheel does not turn, or not about the axle.
    """
    joint = tree.joints.get(wheel)
    kind = None if joint is None else joint.get("type")
    if joint is None or kind != "continuous":
        raise GeometryError(f"{tree.path}: the joint of {wheel!r} has to be continuous, found {kind}")
    axis = joint_axis(joint)
    xyz = xyz_of(axis)
    y = tree.frames[wheel].R @ (xyz / np.linalg.norm(xyz))
    if abs(y[1]) < 1.0 - 0.5 * _ALONG**2:
        raise GeometryError(
            f"{tree.path}: {wheel!r} turns about ({', '.join(f'{v:z.3f}' for v in y)}) of the frame axle; a "
            "wheel turns about its y axis. Is the frame axle turned?"
        )
    return axis, 1.0 if y[1] > 0.0 else -1.0
