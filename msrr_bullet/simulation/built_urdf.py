"""The URDF of a unit as it was built: true places of tags, true wheels, true masses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple
from xml.etree.ElementTree import Element, ElementTree

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.simulation.urdf_welding import joint_of
from msrr_scenes.arrays import Array
from msrr_scenes.as_built import BuiltDrive, BuiltUnit
from msrr_scenes.geometry.inertial import INERTIA
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid, read_solid
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.geometry.urdf_tree import set_origin, urdf_origin
from msrr_scenes.geometry.wheels import WHEEL_LINKS

#: Distance that is kept between a tag and the shapes behind and beside it [m].
_APART_M = 0.0003

#: Distance behind a tag as designed within which it lies on a shape [m], and the share of the edges of its
#: plate that lies there: one that was printed too large stands out.
_ON_M, _ON_SHARE = 0.001, 0.9

#: Depth to which a plate as designed may be in a shape that is taken to be beside it [m].
_SUNK_M = 0.001

#: Edge below which a box is not cut any more [m].
_THINNEST_M = 0.0005


def build(
    tree: ElementTree[Element],
    drawn: UnitGeometry,
    built: BuiltUnit,
    plate_sizes: Mapping[str, float] = MappingProxyType({}),
) -> None:
    """Change a URDF, in place, to what was built; one that is as designed is not touched.

    It is not welded yet, and has the plates of tags or not; ``plate_sizes`` are the edges of those that can
    be seen, by link [m].
    """
    robot = tree.getroot()
    moved = [slot for slot in drawn.tag_slots if built.geometry.frame(slot) is not drawn.frame(slot)]
    walls = _Walls(robot, drawn) if moved else None
    for slot in moved:
        joint = joint_of(robot, slot)
        X_TX = drawn.frame(slot).inverse() @ built.geometry.frame(slot)
        set_origin(joint, urdf_origin(joint.find("origin")) @ X_TX)
    # What is behind a tag would hide all of it, and so gives way last.
    steps = () if walls is None else (walls.carry, walls.give_way_beside, walls.give_way_behind)
    for step in steps:
        for slot in moved:
            step(slot, built.geometry.frame(slot), 0.5 * plate_sizes.get(slot, 0.0))
    if not built.drive.ideal:
        _build_wheels(robot, drawn, built.drive)
    if built.mass_scale != 1.0:
        _scale_masses(robot, built.mass_scale)


class _Wall(NamedTuple):
    """A box or a cylinder that is seen, and points in U that span it, shape (N, 3) [m]."""

    solid: Solid
    points_U: Array


class _Boxes(NamedTuple):
    """Axes, middles in U and half edges [m] of V such shapes; those of a cylinder are endless."""

    R_UG: Array  # (V, 3, 3)
    p_U: Array  # (V, 3)
    half: Array  # (V, 3)

    def beyond(self, plate_U: Array) -> Array:
        """Return how far a plate is beyond their faces at +x, +y, +z, -x, -y and -z, shape (V, 6) [m].

        ``plate_U`` has the corners of the plate, shape (4, 3) [m].
        """
        plate_G = (plate_U - self.p_U[:, None]) @ self.R_UG
        return np.concatenate([plate_G.min(axis=1) - self.half, -plate_G.max(axis=1) - self.half], axis=1)


class _Walls:
    """The visible boxes and cylinders of a URDF, which give way to one tag after the other.

    Plates in the links of tags are not among them: they move with their tags.
    """

    def __init__(self, robot: Element, drawn: UnitGeometry) -> None:
        """Begin with the shapes as designed."""
        self._drawn = drawn
        self._visuals = list(_visuals(robot, drawn))
        self._walls = list(_drawn_walls(drawn))
        self._boxes = _Boxes(*(array.copy() for array in _drawn_boxes(drawn)))
        self._changed: set[int] = set()
        self._carriers: dict[int, str] = {}  # of which tag a shape is the carrier

    def carry(self, slot: str, X_UX: SE3, half: float) -> None:
        """Move the shapes on which a tag lies, such as a roof, with the tag.

        A roof that stayed level under a tag askew would have to be so low that it covers what is beneath it.
        ``X_UX`` is the true pose of the tag, and ``half`` half the edge of its plate [m].
        """
        lowest, highest = _extents(self._drawn, slot)
        below = _ON_SHARE * half
        wide = (lowest[:, :2] <= -below) & (highest[:, :2] >= below)
        lies_on = wide.all(axis=1) & (lowest[:, 2] >= 0.0) & (lowest[:, 2] <= _ON_M)
        for i in np.flatnonzero(lies_on).tolist():
            solid = self._walls[i].solid
            X_UG = X_UX @ self._drawn.frame(slot).inverse() @ solid.X_UG
            self._change(i, replace(solid, X_UG=X_UG))
            self._carriers[i] = slot

    def give_way_beside(self, slot: str, X_UX: SE3, half: float) -> None:
        """Set back the faces of boxes that a plate as designed is beyond and as built is not.

        A tag that was put on lower does not sink into the deck, or behind it: that would cover a part of its
        white border, and an edge would look farther in than it is. ``X_UX`` is the true pose of the tag, and
        ``half`` half the edge of its plate [m].
        """
        as_designed = _drawn_boxes(self._drawn).beyond(_plate(self._drawn.frame(slot), half))
        plate_U = _plate(X_UX, half)
        wanted = np.where(as_designed >= -_SUNK_M, np.minimum(as_designed, _APART_M), -np.inf)
        for i, face in np.argwhere(self._boxes.beyond(plate_U) < wanted).tolist():
            side, axis = divmod(face, 3)
            missing = float(wanted[i, face] - self._boxes.beyond(plate_U)[i, face])
            self._set_back(i, (-1.0, 1.0)[side] * self._boxes.R_UG[i, :, axis], missing)

    def give_way_behind(self, slot: str, X_UX: SE3, half: float) -> None:
        """Set shapes behind a tag back to where the tag is not inside them.

        A tag that was put on deeper than designed is not inside the wall that carries it; the wall is deeper,
        too. ``X_UX`` is the true pose of the tag, and ``half`` half the edge of its plate [m].
        """
        X_TU, X_XU = self._drawn.frame(slot).inverse(), X_UX.inverse()
        behind = _behind(*_extents(self._drawn, slot), half)
        for i, wall in enumerate(self._walls):
            changed = i in self._changed and self._carriers.get(i) != slot
            if not (_behind(*_extent(X_TU, wall), half) if changed else behind[i]):
                continue
            missing = _APART_M - float(X_XU.act(wall.points_U)[:, 2].min())
            if missing > 0.0:
                self._set_back(i, X_UX.R[:, 2], missing)

    def _set_back(self, i: int, back_U: Array, missing: float) -> None:
        """Set a shape back by ``missing`` [m] in the direction ``back_U``.

        A box is cut; one that is too thin, or a cylinder, moves.
        """
        solid = self._walls[i].solid
        size, moved_G = _cut(solid, back_U, missing)
        self._change(i, replace(solid, X_UG=solid.X_UG @ SE3(np.eye(3), moved_G), size=size))

    def _change(self, i: int, solid: Solid) -> None:
        """Put another solid in the place of a shape."""
        link, visual, shape = self._visuals[i]
        if solid.kind == "box":
            shape.set("size", " ".join(map(repr, solid.size)))
        set_origin(visual, self._drawn.frame(link).inverse() @ solid.X_UG)
        self._walls[i] = _Wall(solid, solid.points())
        self._boxes.R_UG[i], self._boxes.p_U[i] = solid.X_UG.R, solid.X_UG.p
        self._boxes.half[i] = _half_edges(solid)
        self._changed.add(i)


def _visuals(robot: Element, drawn: UnitGeometry) -> Iterator[tuple[str, Element, Element]]:
    """Yield link, element and shape of all visible boxes and cylinders that are no part of a tag."""
    for link in robot.findall("link"):
        name = link.attrib["name"]
        for visual in () if name in drawn.tag_slots else link.findall("visual"):
            shape = visual.find("geometry/*")
            if shape is not None and shape.tag in ("box", "cylinder"):
                yield name, visual, shape


# No seed changes what is drawn, and reading it takes far longer than building one unit from it.
@lru_cache(maxsize=32)
def _drawn_walls(drawn: UnitGeometry) -> tuple[_Wall, ...]:
    """Return the visible shapes as designed, in the order of the URDF."""
    visuals = _visuals(drawn.tree().getroot(), drawn)
    solids = [read_solid(link, drawn.frame(link), visual) for link, visual, _ in visuals]
    return tuple(_Wall(solid, solid.points()) for solid in solids)


@lru_cache(maxsize=32)
def _drawn_boxes(drawn: UnitGeometry) -> _Boxes:
    solids = [wall.solid for wall in _drawn_walls(drawn)]
    return _Boxes(
        np.array([solid.X_UG.R for solid in solids]).reshape(-1, 3, 3),
        np.array([solid.X_UG.p for solid in solids]).reshape(-1, 3),
        np.array([_half_edges(solid) for solid in solids]).reshape(-1, 3),
    )


def _half_edges(solid: Solid) -> Array:
    return 0.5 * np.array(solid.size) if solid.kind == "box" else np.full(3, 1e9)


def _plate(X_UT: SE3, half: float) -> Array:
    """Return the corners in U of a plate whose edges are ``2 * half`` long, shape (4, 3) [m]."""
    return X_UT.act(half * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]))


@lru_cache(maxsize=512)
def _extents(drawn: UnitGeometry, slot: str) -> tuple[Array, Array]:
    """Return the lowest and highest coordinates of these shapes in the frame of a tag, (V, 3) each [m]."""
    X_TU = drawn.frame(slot).inverse()
    extents = np.array([_extent(X_TU, wall) for wall in _drawn_walls(drawn)]).reshape(-1, 2, 3)
    return extents[:, 0], extents[:, 1]


def _extent(X_TU: SE3, wall: _Wall) -> tuple[Array, Array]:
    points_T = X_TU.act(wall.points_U)
    return points_T.min(axis=0), points_T.max(axis=0)


def _behind(lowest: Array, highest: Array, half: float) -> NDArray[np.bool_]:
    """Return whether shapes of these extents in T, shape (..., 3) [m], lie behind a plate as designed."""
    beside = (lowest[..., :2] > half).any(axis=-1) | (highest[..., :2] < -half).any(axis=-1)
    behind: NDArray[np.bool_] = (lowest[..., 2] >= 0.0) & ~beside
    return behind


def _cut(solid: Solid, back_U: Array, missing: float) -> tuple[tuple[float, ...], Array]:
    """Return the size that is left of a box, and by how much the middle of a shape moves in its frame [m].

    ``back_U`` is the direction from a tag, and ``missing`` the distance that is missing between them [m].
    """
    back_G = solid.X_UG.R.T @ back_U
    if solid.kind != "box":
        return solid.size, missing * back_G
    size, axis = list(solid.size), int(np.abs(back_G).argmax())
    cut = min(missing, max(size[axis] - _THINNEST_M, 0.0))
    size[axis] -= cut
    moved_G: Array = (missing - cut) * back_G
    moved_G[axis] += 0.5 * cut * np.sign(back_G[axis])
    return tuple(size), moved_G


def _build_wheels(robot: Element, drawn: UnitGeometry, drive: BuiltDrive) -> None:
    """Give the wheels their true radius and track; the axle rises with a wheel, and the body stays level."""
    for name, side, scale in zip(WHEEL_LINKS, (1.0, -1.0), drive.radius_scale, strict=True):
        joint = joint_of(robot, name)
        contact = 0.5 * side * drawn.track  # the frame of a wheel may lie in the middle of the axle
        shift_U = np.array([0.0, (drive.track_scale - 1.0) * contact, (scale - 1.0) * drawn.wheel_radius])
        parent = joint.find("parent")
        assert parent is not None, "read_unit has checked that every joint has a parent"
        shift = drawn.frame(parent.attrib["link"]).R.T @ shift_U
        set_origin(joint, SE3(np.eye(3), shift) @ urdf_origin(joint.find("origin")))
        if scale != 1.0:
            _scale_radius(robot, name, scale)


def _scale_radius(robot: Element, wheel: str, scale: float) -> None:
    """Scale the round shapes of a wheel; read_unit has checked that it has one to roll on."""
    link = next(link for link in robot.findall("link") if link.attrib["name"] == wheel)
    for shape in (*link.findall("collision/geometry/*"), *link.findall("visual/geometry/*")):
        if "radius" in shape.attrib:
            shape.set("radius", repr(scale * float(shape.attrib["radius"])))


def _scale_masses(robot: Element, scale: float) -> None:
    for inertial in robot.findall("link/inertial"):
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        if mass is not None:
            mass.set("value", repr(scale * float(mass.attrib["value"])))
        for moment in INERTIA if inertia is not None else ():
            assert inertia is not None
            inertia.set(moment, repr(scale * float(inertia.get(moment, "0"))))
