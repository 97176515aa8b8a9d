"""Frames of a unit by the links of its URDF.

Robots of other makers name their links otherwise. A frame map says which of their links is which frame; it is
applied where a file is read, so that nothing else knows of it. Frames that a URDF lacks are added to it in
the same way, by a pose in one of its links.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from msrr_scenes.errors import GeometryError, nearest
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.urdf_tree import LinkTree, set_origin
from msrr_scenes.geometry.wheels import WHEEL_LINKS

#: Links that have shapes, contacts or joints of their own; a pose cannot stand for one of them.
_BODIES = re.compile(r"wheel_(left|right)|pin_(left|right)|port_[^_]+_hole_(left|right)")

#: All names of frames, and what messages call them.
_FRAMES = re.compile(rf"axle|camera|tag_top|port_[^_]+|port_[^_]+_marker_.+|{_BODIES.pattern}")
_NAMES = ("axle", "camera", "wheel_left", "wheel_right", "tag_top", "pin_left", "pin_right", "port_front")
_PATTERNS = ("port_<name>", "port_<name>_marker_<tag>", "port_<name>_hole_left", "port_<name>_hole_right")


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
    """A frame map that does not fit its URDF; ``frame`` is the name of the frame at fault."""

    def __init__(self, frame: str, text: str) -> None:
        """Compose the message, which begins with the name of the frame."""
        super().__init__(text)
        self.frame = frame


def apply_frame_map(path: Path, root: Element, frames: FrameMap) -> None:
    """Give links of a URDF the names of this project, in place: rename bodies, add all other frames as links.

    In the map a frame follows those that it refers to. The file is named in messages.

    Raises:
        FrameMapError: A frame is not one of a unit, or its link is not in the URDF.
    """
    _Mapping(path, root, frames).apply()


def check_rigid(tree: LinkTree) -> None:
    """Refuse a frame that a joint moves against the axle, but for wheels.

    Raises:
        GeometryError: There is one; the message names the joint.
    """
    for name in tree.links:
        if not _FRAMES.fullmatch(name) or name in WHEEL_LINKS:
            continue
        for link in tree.chain(name)[:-1]:
            kind = tree.joints[link].get("type")
            if kind != "fixed":
                raise GeometryError(
                    f"{tree.path}: joint {tree.joints[link].get('name')!r} ({kind}) moves the frame "
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
        """Return the new names of links: those of bodies, and others for links whose name is taken.

        These match no pattern of frames: a second tag would have an id, and change those of others.
        """
        taken = [f.name for f in self._frames if f.name in self._links and f.changes]
        renamed = {name: f"in_urdf_{name}" for name in taken}
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
