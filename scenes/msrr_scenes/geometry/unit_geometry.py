"""The geometry of a unit, read from its URDF and from nowhere else.

A unit's URDF names the frames that matter as links: ``axle`` (frame U: on the ground under the middle of the
axle, x forward), ``camera`` (x along the optical axis), ``port_<name>`` (on the ground under the port's
face, x out of the face), ``tag_top`` and, for each passive port, one ``port_<name>_marker_<tag>`` for each of
its tags, on the shipped unit ``left``, ``middle`` and ``right`` (tag frames: x right, y down, z into the tag,
as a viewer in front of the tag sees it). The lock needs the links ``pin_{left,right}`` and, for each passive
port, ``port_<name>_hole_{left,right}``: the bottoms of the holes. Any URDF with these frames works, under
other names with a frame map (:mod:`msrr_scenes.geometry.frame_map`).

A fixture, ``<robot kind="fixture">``, is docked to and does not drive: it needs the link ``axle`` and its
ports alone.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection
from copy import deepcopy
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError, SceneError, nearest
from msrr_scenes.file_cache import FileCache
from msrr_scenes.geometry.frame_map import FrameMap, check_rigid
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid, convex_hull, read_solids
from msrr_scenes.geometry.urdf_file import WheelJoint, read_urdf, read_wheel_joints
from msrr_scenes.geometry.urdf_tree import LinkTree
from msrr_scenes.geometry.wheels import measure_wheels

#: Rotation by pi: from a port's frame P (x out of the face) to its dock frame D (x into the unit).
X_PD = SE2(0.0, 0.0, math.pi)

#: Kind of a body without a drive in its URDF.
FIXTURE = "fixture"

_PACKAGE = Path(__file__).resolve().parents[1]


@cache
def urdf_folder() -> Path:
    """Return the folder of the shipped URDFs: inside the package when installed, ``urdf/`` in a checkout."""
    installed = _PACKAGE / "urdf"
    return installed if installed.is_dir() else _PACKAGE.parents[1] / "urdf"


@cache
def library_folder() -> Path:
    """Return the folder of the shipped scene files."""
    return _PACKAGE / "library"


def find_urdf(name: str, beside: Path | None = None) -> Path:
    """Return the path of a URDF file of this name.

    The folder of the scene file, ``beside``, is searched before the working folder and the shipped URDFs. A
    shipped scene means the shipped robots, whatever lies in the working folder.

    Raises:
        SceneError: None of these folders holds the file.
    """
    first = urdf_folder() if beside == library_folder() else beside
    if first is not None and (path := first / name).is_file():
        return path
    for folder in (Path.cwd(), urdf_folder()):
        if (path := folder / name).is_file():
            return path
    raise SceneError(f"no URDF named {name!r} beside the scene, in the working folder or in {urdf_folder()}")


def tag_corners(size: float) -> Array:
    """Return the corners of a tag's black border in T, shape (4, 3) [m]: bottom left, then counter-clockwise.

    ``size`` is the edge of the black square [m]. T is x right, y down, z into the tag.
    """
    h = 0.5 * size
    return np.array([[-h, h, 0.0], [h, h, 0.0], [h, -h, 0.0], [-h, -h, 0.0]])


@dataclass(frozen=True, eq=False)
class UnitGeometry:
    """The frames and collision shapes of a unit with all joints at zero.

    Attributes:
        urdf: URDF file of the unit.
        frames: ``X_UF`` of every link F.
        solids: Collision shapes.
        wheel_radius: Radius of the wheels [m]; 0 for a fixture.
        track: Distance between the wheels' contact points [m]; 0 for a fixture.
        frame_map: Frames by links of the URDF that have other names than those of this project.
    """

    urdf: Path
    frames: dict[str, SE3]
    solids: tuple[Solid, ...]
    wheel_radius: float
    track: float
    frame_map: FrameMap = ()

    def tree(self) -> ElementTree[Element]:
        """Return a copy of the URDF, its links by the names of this project, its wheels turning forward."""
        return deepcopy(self._tree)

    @cached_property
    def _tree(self) -> ElementTree[Element]:
        return read_urdf(self.urdf, self.frame_map)

    @cached_property
    def link_tree(self) -> LinkTree:
        """Links and joints of :meth:`tree`, without a copy: to be read, not to be changed."""
        return LinkTree(self.urdf, self._tree.getroot())

    def frame(self, name: str) -> SE3:
        """Return ``X_UF`` of link ``name``.

        Raises:
            GeometryError: The unit has no such link; the message lists those that it has.
        """
        try:
            return self.frames[name]
        except KeyError:
            raise GeometryError(
                f"{self.urdf}: no link named {name!r}; links: {', '.join(sorted(self.frames))}"
            ) from None

    def name_in_urdf(self, link: str) -> str:
        """Return the link of the URDF itself that a link of :meth:`tree` is, or has its pose in."""
        return next((frame.link for frame in self.frame_map if frame.name == link), link)

    @property
    def drives(self) -> bool:
        """Whether it is a unit, and no fixture."""
        return self.wheel_radius > 0.0

    @cached_property
    def wheel_joints(self) -> tuple[WheelJoint, WheelJoint]:
        """Joints of the left and the right wheel of a unit, as its URDF has them."""
        return read_wheel_joints(self.urdf, self.frame_map)

    @cached_property
    def ports(self) -> tuple[str, ...]:
        """Names of the ports, without the prefix ``port_``."""
        return tuple(
            name.removeprefix("port_")
            for name in self.frames
            if name.startswith("port_") and name.count("_") == 1
        )

    @cached_property
    def passive_ports(self) -> tuple[str, ...]:
        """Ports that carry a marker, in the order of the URDF."""
        return tuple(p for p in self.ports if self.marker_slots(p))

    @cached_property
    def active_ports(self) -> tuple[str, ...]:
        """Ports that have neither a marker nor holes."""
        passive = {name.split("_")[1] for name in self.frames if re.match("port_[^_]+_(marker|hole)_", name)}
        return tuple(p for p in self.ports if p not in passive)

    def port(self, name: str) -> SE2:
        """Return ``X_UP`` of a port: the origin is on the face, x points out of the unit."""
        return self.frame(f"port_{name}").to_se2()

    def dock_frame(self, name: str) -> SE2:
        """Return ``X_UD`` of a port: the origin is on the face, x points into the unit."""
        return self.port(name) @ X_PD

    def control_offset(self, port: str) -> float:
        """Return l, the distance [m] of an active port ahead of the axle."""
        return self.port(port).x

    @cached_property
    def pin_height(self) -> float:
        """Height of the middle of the pins above the ground [m]: the height of the docking axis.

        Raises:
            GeometryError: The unit has no pins.
        """
        heights = [solid.points()[:, 2] for solid in self.pin_solids()]
        return round(float(np.mean([0.5 * (z.min() + z.max()) for z in heights])), 9)

    def pin_solids(self) -> list[Solid]:
        """Return the collision shapes of the pins, one at least.

        Raises:
            GeometryError: The unit has no pins.
        """
        found = [solid for solid in self.solids if solid.link in self.pins]
        if not found:
            raise GeometryError(
                f"{self.urdf}: neither pin_left nor pin_right has a collision shape; a unit docks by pins"
            )
        return found

    @cached_property
    def tag_slots(self) -> tuple[str, ...]:
        """Links that carry a tag, in the order of the tag ids: top, then per port left, middle, right."""
        slots = ["tag_top"] if "tag_top" in self.frames else []
        for port in self.passive_ports:
            slots += self.marker_slots(port)
        return tuple(slots)

    def marker_slots(self, port: str) -> list[str]:
        """Return the links of the tags of a port, the usual three first; none for an active port."""
        tags = [name for name in self.frames if name.startswith(f"port_{port}_marker_")]
        usual = [name for name in marker_links(port) if name in tags]
        return usual + [name for name in tags if name not in usual]

    @cached_property
    def pins(self) -> tuple[str, ...]:
        """Links of the pins of the active port; a link of another name, such as ``pin_cover``, is none."""
        return tuple(name for name in self.frames if name in ("pin_left", "pin_right"))

    @cached_property
    def footprint(self) -> Array:
        """Convex outline of all shapes on the ground, shape (N, 2) [m], counter-clockwise."""
        return convex_hull(np.concatenate([solid.outline() for solid in self.solids]))

    @cached_property
    def circumradius(self) -> float:
        """Largest distance of the footprint from the axle's middle [m]."""
        return float(np.linalg.norm(self.footprint, axis=1).max())


def marker_links(port: str) -> list[str]:
    """Return the links of the tags of a port of the shipped unit."""
    return [f"port_{port}_marker_{side}" for side in ("left", "middle", "right")]


def read_unit(path: Path, frame_map: FrameMap = ()) -> UnitGeometry:
    """Read a unit's URDF; while its files stay as they are, every call returns the same object.

    Raises:
        GeometryError: The file is missing, is not a tree of links, or lacks a frame that every unit needs.
    """
    return _read(path, frame_map)


def _read_anew(path: Path, frame_map: FrameMap) -> tuple[UnitGeometry, list[Path]]:
    """Return a unit, and the files with its shapes."""
    try:
        unit = _read_tree(path, frame_map)
    except (LookupError, ValueError) as error:
        raise GeometryError(f"{path}: malformed URDF: {error!r}") from None
    meshes = (mesh for link in unit.link_tree.links.values() for mesh in link.iter("mesh"))
    return unit, [path, *(Path(mesh.get("filename", "")) for mesh in meshes)]


_read = FileCache(_read_anew, most=64)


def _check_markers(path: Path, links: Collection[str]) -> None:
    """Refuse a tag whose name is nearly that of a usual one which its port does not have."""
    for port in (name.removeprefix("port_") for name in links if re.fullmatch("port_[^_]+", name)):
        missing = [name for name in marker_links(port) if name not in links]
        others = [name for name in links if name.startswith(f"port_{port}_marker_")]
        others = [name for name in others if name not in marker_links(port)]
        # Several on one side, as left1 and left2, are no mistake.
        mistaken = [
            name
            for name in missing
            if difflib.get_close_matches(name, others, n=1, cutoff=0.95)
            and sum(other.rstrip("0123456789") == name for other in others) < 2
        ]
        if mistaken:
            raise GeometryError(
                f"{path}: port {port!r} lacks the link(s) {', '.join(mistaken)}{nearest(mistaken[0], others)}"
            )


def _read_tree(path: Path, frame_map: FrameMap) -> UnitGeometry:
    root = read_urdf(path, frame_map).getroot()
    tree = LinkTree(path, root)
    fixture = root.get("kind") == FIXTURE
    required = ("axle",) if fixture else ("axle", "camera", "wheel_left", "wheel_right", "port_front")
    missing = [name for name in required if name not in tree.links]
    if missing:
        raise GeometryError(
            f"{path}: lacks the link(s) {', '.join(missing)}; a unit needs {', '.join(required)}. Links of "
            f"other names are mapped in the scene, as in frames: {{{missing[0]}: <link>}}; the URDF has "
            f"{', '.join(tree.links) or 'no links'}"
        )
    check_rigid(tree)
    solids = tuple(
        solid
        for name, link in tree.links.items()
        for collision in link.findall("collision")
        for solid in read_solids(name, tree.frames[name], collision)
    )
    if fixture:
        return UnitGeometry(path, tree.frames, solids, 0.0, 0.0, frame_map)
    _check_markers(path, tree.frames)
    radius, track = measure_wheels(path, tree.frames, solids)
    return UnitGeometry(path, tree.frames, solids, radius, track, frame_map)
