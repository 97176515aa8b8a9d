"""The tree of a URDF, with its links under the names that this project uses.

Robots of other makers name their links otherwise. A frame map says which of their links is which frame; it is
applied here, where a file is read, so that nothing else knows of it. Frames that a URDF lacks are added to it
in the same way, by a pose in one of its links.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, ElementTree, ParseError, SubElement, parse

import numpy as np

from msrr_scenes.errors import GeometryError, nearest
from msrr_scenes.geometry.se3 import SE3

#: Links that have shapes, contacts or joints of their own; a pose cannot stand for one of them.
_BODIES = re.compile(r"wheel_(left|right)|pin_(left|right)|port_[^_]+_hole_(left|right)")

_WHEELS = ("wheel_left", "wheel_right")

#: All names of frames, and what messages call them.
_FRAMES = re.compile(rf"axle|camera|tag_top|port_[^_]+|port_[^_]+_marker_.+|{_BODIES.pattern}")
_NAMES = ("axle", "camera", *_WHEELS, "tag_top", "pin_left", "pin_right", "port_front")
_PATTERNS = ("port_<name>", "port_<name>_marker_<tag>", "port_<name>_hole_left", "port_<name>_hole_right")

_PACKAGE_SCHEME = "package://"
_XACRO = re.compile(r"\{[^}]*xacro[^}]*\}")

#: Largest deviation of the direction of an axis from that of the drawing [rad].
_ALONG = 1e-3


class MappedFrame(NamedTuple):
    """A frame of a unit, by a link of its URDF.

    Attributes:
        name: Name of the frame in this project.
        link: Name of a link in the URDF; or, but for bodies, of a frame that comes earlier in the map.
        xyz: Place of the frame in the link [m].
        rpy: Rotation of the frame in the link: roll, pitch and yaw [rad].
    """

    name: str
    link: str
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def moved(self) -> bool:
        """Whether the frame is not that of the link itself."""
        return any((*self.xyz, *self.rpy))

    @property
    def changes(self) -> bool:
        """Whether the URDF does not have the frame under its name already."""
        return self.moved or self.link != self.name


FrameMap = tuple[MappedFrame, ...]


class FrameMapError(GeometryError):
    """A frame map that does not fit its URDF.

    Attributes:
        frame: Name of the frame at fault.
    """

    def __init__(self, frame: str, text: str) -> None:
        """Compose the message, which begins with the name of the frame."""
        super().__init__(text)
        self.frame = frame


def read_urdf(path: Path, frames: FrameMap = ()) -> ElementTree[Element]:
    """Read a URDF: file names absolute, links by the names of this project, wheels turning forward.

    Args:
        path: The file.
        frames: Frames by links of the URDF, in an order in which a frame follows those that it refers to.

    Raises:
        GeometryError: The file is missing or is no URDF, or a joint names a link that is not in it.
        FrameMapError: A frame is not one of a unit, or its link is not in the URDF.
    """
    try:
        tree = parse(path)
    except FileNotFoundError:
        raise GeometryError(f"{path}: no such URDF file") from None
    except ParseError as error:
        raise GeometryError(f"{path}: not well-formed XML: {error}") from None
    for element in tree.iter():
        if _XACRO.match(element.tag):
            raise GeometryError(f"{path}: holds macros; expand them first: xacro {path.name} > robot.urdf")
        if element.tag in ("mesh", "texture") and "filename" in element.attrib:
            element.set("filename", str(_resolved(path, element.attrib["filename"])))
    root = tree.getroot()
    _check_joints(path, root)
    if frames:
        _Mapping(path, root, frames).apply()
    links = LinkTree(path, root)
    if {"axle", *_WHEELS} <= links.links.keys():
        _turn_wheels_forward(path, links)
    return tree


def _resolved(urdf: Path, name: str) -> Path:
    """Return the path of a file that a URDF names, beside itself or as ROS does, by a package."""
    if not name.startswith(_PACKAGE_SCHEME):
        return (urdf.parent / name.removeprefix("file://")).resolve()
    package, _, rest = name.removeprefix(_PACKAGE_SCHEME).partition("/")
    for folder in urdf.resolve().parents:
        if folder.name == package:
            return folder / rest
    raise GeometryError(
        f"{urdf}: {name}: the URDF is in no folder {package!r}; put it back there, or write the path from "
        "the URDF to the file"
    )


def _check_joints(path: Path, root: Element) -> None:
    """Refuse a joint between links of which one is missing, before a frame map adds links.

    Raises:
        GeometryError: There is one.
    """
    links = [link.get("name", "") for link in root.findall("link")]
    for joint in root.findall("joint"):
        for end in (*joint.findall("parent"), *joint.findall("child")):
            name = end.get("link", "")
            if name not in links:
                raise GeometryError(
                    f"{path}: joint {joint.get('name')!r} names the link {name!r} as its {end.tag}, which is "
                    f"not in the file{nearest(name, links)} Links: {', '.join(links)}"
                )


def urdf_origin(element: Element | None) -> SE3:
    """Return the pose in an ``<origin>`` of a URDF; the identity for None."""
    if element is None:
        return SE3()
    xyz = [float(a) for a in element.get("xyz", "0 0 0").split()]
    rpy = [float(a) for a in element.get("rpy", "0 0 0").split()]
    return SE3.from_xyz_rpy(xyz, rpy)


def set_origin(element: Element, X: SE3) -> None:
    """Set the pose of a joint, a shape or an inertia of a URDF."""
    for old in element.findall("origin"):
        element.remove(old)
    xyz, rpy = (" ".join(repr(float(value)) for value in part) for part in (X.p, X.rpy()))
    element.insert(0, Element("origin", xyz=xyz, rpy=rpy))


class LinkTree:
    """The poses of all links of a URDF with all joints at zero."""

    def __init__(self, path: Path, root: Element) -> None:
        """Read the joints.

        Raises:
            GeometryError: A joint lacks a parent or a child.
        """
        self._path = path
        self.links = {e.attrib["name"]: e for e in root.findall("link")}
        self.joints: dict[str, Element] = {}
        self._parent: dict[str, tuple[str, SE3]] = {}
        for joint in root.findall("joint"):
            up, down = joint.find("parent"), joint.find("child")
            if up is None or down is None:
                raise GeometryError(f"{path}: joint {joint.get('name')!r} lacks a parent or a child")
            child = down.attrib["link"]
            self._parent[child] = (up.attrib["link"], urdf_origin(joint.find("origin")))
            self.joints[child] = joint

    def chain(self, name: str) -> list[str]:
        """Return a link and all that carry it, up to the root.

        Raises:
            GeometryError: The links form no tree.
        """
        chain = [name]
        while chain[-1] in self._parent:
            above = self._parent[chain[-1]][0]
            if above in chain or above not in self.links:
                raise GeometryError(f"{self._path}: the links do not form a tree at {above!r}")
            chain.append(above)
        return chain

    def pose(self, name: str) -> SE3:
        """Return the pose of a link in the root link."""
        X = SE3()
        for link in self.chain(name)[:-1]:
            X = self._parent[link][1] @ X
        return X

    @cached_property
    def frames(self) -> dict[str, SE3]:
        """``X_UF`` of every link F, given that there is a link ``axle``."""
        X_AR = self.pose("axle").inverse()
        return {name: X_AR @ self.pose(name) for name in self.links}

    def check_rigid(self) -> None:
        """Refuse a frame that a joint moves against the axle, but for wheels.

        Raises:
            GeometryError: There is one; the message names the joint.
        """
        for name in self.links:
            if not _FRAMES.fullmatch(name) or name.startswith("wheel_"):
                continue
            for link in self.chain(name)[:-1]:
                kind = self.joints[link].get("type")
                if kind != "fixed":
                    raise GeometryError(
                        f"{self._path}: joint {self.joints[link].get('name')!r} ({kind}) moves the frame "
                        f"{name!r}; make it a fixed one"
                    )


class _Mapping:
    def __init__(self, path: Path, root: Element, frames: Sequence[MappedFrame]) -> None:
        self._path, self._root, self._frames = path, root, frames
        self._links = [link.attrib["name"] for link in root.findall("link")]

    def apply(self) -> None:
        """Rename bodies, and add all other frames as links of their own."""
        earlier = set[str]()
        for frame in self._frames:
            self._check(frame, earlier)
            earlier.add(frame.name)
        renamed = self._renamed()
        for element, key in self._names():
            name = element.attrib[key]
            element.set(key, renamed.get(name, name))
        earlier.clear()
        for frame in self._frames:
            parent = frame.link if frame.link in earlier else renamed.get(frame.link, frame.link)
            if not _BODIES.fullmatch(frame.name) and frame.changes:
                self._add(frame, parent)
            earlier.add(frame.name)

    def _renamed(self) -> dict[str, str]:
        """Return the new names of links: those of bodies, and others for links whose name is taken."""
        taken = [f.name for f in self._frames if f.name in self._links and f.changes]
        renamed = {name: f"{name}_in_urdf" for name in taken}
        bodies: dict[str, str] = {}
        for frame in self._frames:
            if _BODIES.fullmatch(frame.name):
                if frame.link in bodies:
                    text = f"link {frame.link!r} is {bodies[frame.link]!r} already; a body is one link"
                    raise self._error(frame, text)
                bodies[frame.link] = frame.name
        return {**renamed, **bodies}

    def _names(self) -> Iterator[tuple[Element, str]]:
        """Yield every element that names a link, with the key of the name."""
        yield from ((link, "name") for link in self._root.findall("link"))
        for tag in ("parent", "child"):
            yield from ((end, "link") for end in self._root.findall(f"joint/{tag}"))

    def _check(self, frame: MappedFrame, earlier: set[str]) -> None:
        if not _FRAMES.fullmatch(frame.name):
            near = nearest(frame.name, _NAMES)
            raise FrameMapError(
                frame.name, f"no frame of a unit{near} Frames: {', '.join((*_NAMES, *_PATTERNS))}"
            )
        body = _BODIES.fullmatch(frame.name)
        if frame.link not in self._links and (body or frame.link not in earlier):
            near = nearest(frame.link, self._links)
            raise self._error(
                frame, f"no link {frame.link!r} for {frame.name!r}{near} Links: {', '.join(self._links)}"
            )
        if body and frame.moved:
            raise self._error(
                frame, f"{frame.name!r} is a body, so it is a link itself and has no pose in one"
            )

    def _error(self, frame: MappedFrame, text: str) -> FrameMapError:
        return FrameMapError(frame.name, f"{self._path.name}: {text}")

    def _add(self, frame: MappedFrame, parent: str) -> None:
        SubElement(self._root, "link", name=frame.name)
        joint = SubElement(self._root, "joint", name=f"{frame.name}_mapped", type="fixed")
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=frame.name)
        set_origin(joint, SE3.from_xyz_rpy(frame.xyz, frame.rpy))


def _turn_wheels_forward(path: Path, tree: LinkTree) -> None:
    """Turn the axes of both wheels to the left, in place, so that a positive speed drives forward.

    Raises:
        GeometryError: A wheel does not turn, or not about the axle.
    """
    for name in _WHEELS:
        joint = tree.joints.get(name)
        kind = None if joint is None else joint.get("type")
        if joint is None or kind not in ("continuous", "revolute"):
            raise GeometryError(f"{path}: the joint of {name!r} has to be continuous, found {kind}")
        axis = joint.find("axis")
        if axis is None:
            axis = SubElement(joint, "axis", xyz="1 0 0")
        xyz = np.array([float(a) for a in axis.attrib["xyz"].split()])
        y = tree.frames[name].R @ (xyz / np.linalg.norm(xyz))
        if abs(y[1]) < 1.0 - 0.5 * _ALONG**2:
            raise GeometryError(
                f"{path}: {name!r} turns about ({', '.join(f'{v:.3f}' for v in y)}) of the frame axle; a "
                "wheel turns about its y axis. Is the frame axle turned?"
            )
        if y[1] < 0.0:
            axis.set("xyz", " ".join(repr(float(a)) for a in -xyz))
