"""The geometry of a unit, read from its URDF and from nowhere else.

A unit's URDF names the frames that matter as links: ``axle`` (frame U: on the ground under the middle of the
axle, x forward), ``camera`` (x along the optical axis), ``port_<name>`` (on the ground under the port's
face, x out of the face), ``tag_top`` and, for each passive port, ``port_<name>_marker_{left,middle,right}``
(tag frames: x right, y down, z into the tag, as a viewer in front of the tag sees it). The lock needs the
links ``pin_{left,right}`` and, for each passive port, ``port_<name>_hole_{left,right}``: the bottoms of the
holes. Any URDF with these frames works.

A fixture, ``<robot kind="fixture">``, is docked to and does not drive: it needs the link ``axle`` and its
ports alone, and a port may carry any tags: links ``port_<name>_marker_...``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError, SceneError, nearest
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid, convex_hull

#: Rotation by pi: from a port's frame P (x out of the face) to its dock frame D (x into the unit).
X_PD = SE2(0.0, 0.0, math.pi)

#: Kind of a body without a drive in its URDF.
FIXTURE = "fixture"

_PACKAGE = Path(__file__).resolve().parents[1]


def urdf_folder() -> Path:
    """Return the folder of the shipped URDFs: inside the package when installed, ``urdf/`` in a checkout."""
    installed = _PACKAGE / "urdf"
    return installed if installed.is_dir() else _PACKAGE.parents[1] / "urdf"


def find_urdf(name: str, beside: Path | None = None) -> Path:
    """Return the path of a URDF file.

    Args:
        name: File name.
        beside: Folder of the scene file, searched before the working folder and the shipped URDFs.

    Raises:
        SceneError: None of these folders holds the file.
    """
    for folder in ([beside] if beside else []) + [Path.cwd(), urdf_folder()]:
        path = folder / name
        if path.is_file():
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
    """

    urdf: Path
    frames: dict[str, SE3]
    solids: tuple[Solid, ...]
    wheel_radius: float
    track: float

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

    @property
    def drives(self) -> bool:
        """Whether it is a unit, and no fixture."""
        return self.wheel_radius > 0.0

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
        return tuple(p for p in self.ports if self._marker_slots(p))

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
        heights = [float(solid.X_UG.p[2]) for solid in self.solids if solid.link.startswith("pin_")]
        if not heights:
            raise GeometryError(
                f"{self.urdf}: no link named pin_* has a collision shape; a unit docks by pins"
            )
        return float(np.mean(heights))

    @cached_property
    def tag_slots(self) -> tuple[str, ...]:
        """Links that carry a tag, in the order of the tag ids: top, then per port left, middle, right."""
        slots = ["tag_top"] if "tag_top" in self.frames else []
        for port in self.passive_ports:
            slots += self._marker_slots(port)
        return tuple(slots)

    def _marker_slots(self, port: str) -> list[str]:
        """Return the links of the tags of a port; none for an active port."""
        if self.drives:
            return marker_links(port) if self.frames.keys() & marker_links(port) else []
        return [name for name in self.frames if name.startswith(f"port_{port}_marker_")]

    @cached_property
    def pins(self) -> tuple[str, ...]:
        """Links of the pins of the active port."""
        return tuple(name for name in self.frames if name.startswith("pin_"))

    @cached_property
    def footprint(self) -> Array:
        """Convex outline of all shapes on the ground, shape (N, 2) [m], counter-clockwise."""
        return convex_hull(np.concatenate([solid.outline() for solid in self.solids]))

    @cached_property
    def circumradius(self) -> float:
        """Largest distance of the footprint from the axle's middle [m]."""
        return float(np.linalg.norm(self.footprint, axis=1).max())


def marker_links(port: str) -> list[str]:
    """Return the links of the tags of a passive port."""
    return [f"port_{port}_marker_{side}" for side in ("left", "middle", "right")]


def urdf_origin(element: ElementTree.Element | None) -> SE3:
    """Return the pose in an ``<origin>`` of a URDF; the identity for None."""
    if element is None:
        return SE3()
    xyz = [float(a) for a in element.get("xyz", "0 0 0").split()]
    rpy = [float(a) for a in element.get("rpy", "0 0 0").split()]
    return SE3.from_xyz_rpy(xyz, rpy)


def _solid(link: str, X_UL: SE3, collision: ElementTree.Element, folder: Path) -> Solid:
    X_UG = X_UL @ urdf_origin(collision.find("origin"))
    geometry = collision.find("geometry")
    shape = geometry[0] if geometry is not None and len(geometry) else None
    if shape is None:
        raise GeometryError(f"link {link!r}: a <collision> without a shape")
    if shape.tag == "box":
        return Solid(link, "box", X_UG, tuple(float(a) for a in shape.attrib["size"].split()))
    if shape.tag == "cylinder":
        return Solid(link, "cylinder", X_UG, (float(shape.attrib["radius"]), float(shape.attrib["length"])))
    if shape.tag == "sphere":
        return Solid(link, "sphere", X_UG, (float(shape.attrib["radius"]),))
    if shape.tag == "mesh":
        scale = tuple(float(a) for a in shape.get("scale", "1 1 1").split())
        return Solid(link, "mesh", X_UG, scale, folder / shape.attrib["filename"])
    raise GeometryError(f"link {link!r}: unsupported shape <{shape.tag}>; use box, cylinder, sphere or mesh")


@lru_cache(maxsize=32)
def read_unit(path: Path) -> UnitGeometry:
    """Read a unit's URDF.

    Raises:
        GeometryError: The file is missing, is not a tree of links, or lacks a frame that every unit needs.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except FileNotFoundError:
        raise GeometryError(f"{path}: no such URDF file") from None
    except ElementTree.ParseError as error:
        raise GeometryError(f"{path}: not well-formed XML: {error}") from None
    try:
        return _read_tree(path, root)
    except (KeyError, ValueError) as error:
        raise GeometryError(f"{path}: malformed URDF: {error!r}") from None


def _check_markers(path: Path, links: Collection[str]) -> None:
    """Refuse a port with a part of a marker, or with holes and no marker: a link has a wrong name."""
    for port in (name.removeprefix("port_") for name in links if re.fullmatch("port_[^_]+", name)):
        missing = [name for name in marker_links(port) if name not in links]
        passive = len(missing) < 3 or any(name.startswith(f"port_{port}_hole_") for name in links)
        if passive and missing:
            near = nearest(missing[0], links)
            raise GeometryError(
                f"{path}: port {port!r} is passive and lacks the link(s) {', '.join(missing)}{near}"
            )


def _read_tree(path: Path, root: ElementTree.Element) -> UnitGeometry:
    links = {e.attrib["name"]: e for e in root.findall("link")}
    parent: dict[str, tuple[str, SE3]] = {}
    for joint in root.findall("joint"):
        up, down = joint.find("parent"), joint.find("child")
        if up is None or down is None:
            raise GeometryError(f"{path}: joint {joint.get('name')!r} lacks a parent or a child")
        parent[down.attrib["link"]] = (up.attrib["link"], urdf_origin(joint.find("origin")))

    def to_root(name: str) -> SE3:
        X, seen = SE3(), {name}
        while name in parent:
            name, X_step = parent[name]
            if name in seen or name not in links:
                raise GeometryError(f"{path}: the links do not form a tree at {name!r}")
            seen.add(name)
            X = X_step @ X
        return X

    fixture = root.get("kind") == FIXTURE
    required = ("axle",) if fixture else ("axle", "camera", "wheel_left", "wheel_right", "port_front")
    missing = [name for name in required if name not in links]
    if missing:
        raise GeometryError(
            f"{path}: lacks the link(s) {', '.join(missing)}; a unit needs {', '.join(required)}"
        )
    X_AR = to_root("axle").inverse()
    frames = {name: X_AR @ to_root(name) for name in links}
    solids = tuple(
        _solid(name, frames[name], collision, path.parent)
        for name, link in links.items()
        for collision in link.findall("collision")
    )
    if fixture:
        return UnitGeometry(path, frames, solids, 0.0, 0.0)
    _check_markers(path, frames)
    wheel = next(s for s in solids if s.link == "wheel_left")
    track = float(frames["wheel_left"].p[1] - frames["wheel_right"].p[1])
    return UnitGeometry(path, frames, solids, wheel.size[0], track)
