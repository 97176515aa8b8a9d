"""Collision shapes and the points that span them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.mesh_points import obj_objects, obj_vertices
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.urdf_tree import urdf_origin

#: Three points are on one line when they span at most this parallelogram [m^2]. Corners on a grid of
#: micrometres span at least ten times as much; a rounding of a position in a room spans a tenth.
_FLAT_M2 = 1e-13

#: Number of points from which those well inside are left out of a hull first, and directions in which the
#: outermost points are looked for, shape (2, N).
_MANY = 64
_OUTWARDS: Array = np.stack([f(np.arange(16) * (math.pi / 8.0)) for f in (np.cos, np.sin)])

#: Tilt of a cylinder below which it is upright: a rounding of the angles in a drawing, such as 3.14159.
_UPRIGHT = 1e-4

#: Shapes without a file, and the attributes of a URDF that give their sizes.
PRIMITIVES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}

#: The same of all that is drawn; PyBullet takes the length of a capsule to be that between its two middles.
DRAWN_PRIMITIVES = {**PRIMITIVES, "capsule": ("radius", "length")}


@dataclass(frozen=True, eq=False)
class Solid:
    """A collision shape of a unit, or the shape of an obstacle.

    Attributes:
        link: Link that carries the shape; empty for an obstacle.
        kind: ``box``, ``cylinder``, ``sphere`` or ``mesh``.
        X_UG: Pose of the shape's frame G in U with all joints at zero; in B for an obstacle.
        size: Full edges of a box, radius and length of a cylinder, radius of a sphere [m], scale of a mesh.
        mesh: OBJ file of a mesh, None for other shapes.
        part: Which object of that file the shape is, None for all of it. With the first the file is drawn.
    """

    link: str
    kind: str
    X_UG: SE3
    size: tuple[float, ...]
    mesh: Path | None = None
    part: int | None = None

    @property
    def is_disc(self) -> bool:
        """Whether the shape's projection to the ground is a disc: that of a sphere or an upright cylinder."""
        upright = math.hypot(self.X_UG.R[0, 2], self.X_UG.R[1, 2]) < _UPRIGHT
        return self.kind == "sphere" or (self.kind == "cylinder" and upright)

    def outline(self) -> Array:
        """Return points in U, shape (N, 2) [m], whose convex hull is the shape's projection to the ground.

        A disc is given by the polygon of 32 corners around it, and the circles of another round shape by 32
        points on each.
        """
        if self.is_disc:
            return self.X_UG.p[:2] + self.size[0] / math.cos(math.pi / 32) * _circle()
        return self.points()[:, :2]

    def points(self) -> Array:
        """Return points in U, shape (N, 3) [m], whose convex hull is the shape.

        Round shapes are given by 32 points on each circle.
        """
        if self.kind == "box":
            corners = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
            return self.X_UG.act(corners * np.asarray(self.size))
        if self.kind == "cylinder":
            radius, length = self.size
            ring = np.column_stack([radius * _circle(), np.full(32, 0.5 * length)])
            return self.X_UG.act(np.concatenate([ring, ring * np.array([1.0, 1.0, -1.0])]))
        if self.kind == "sphere":
            rings = [
                np.column_stack([math.cos(a) * _circle(), np.full(32, math.sin(a))])
                for a in np.linspace(-0.5 * math.pi, 0.5 * math.pi, 9)
            ]
            return self.X_UG.act(self.size[0] * np.concatenate(rings))
        assert self.mesh is not None
        vertices = obj_vertices(self.mesh) if self.part is None else obj_objects(self.mesh)[self.part]
        return self.X_UG.act(vertices * np.asarray(self.size))

    def lowest(self) -> Array:
        """Return a point in U that is as low as any of the shape, shape (3,) [m], also of a round one."""
        axis: Array = self.X_UG.R[:, 2]
        tilt = math.hypot(axis[0], axis[1])
        points = self.points()
        lowest: Array = points[points[:, 2].argmin()]
        if self.kind == "sphere":
            lowest = self.X_UG.p - np.array([0.0, 0.0, self.size[0]])
        elif self.kind == "cylinder" and tilt > 0.0:
            radius, length = self.size
            down = -math.copysign(1.0, axis[2]) * axis
            rim = np.array([-down[0] * down[2], -down[1] * down[2], tilt**2]) / -tilt
            lowest = self.X_UG.p + 0.5 * length * down + radius * rim
        return lowest


def read_solids(link: str, X_UL: SE3, collision: Element) -> list[Solid]:
    """Return the convex shapes of a ``<collision>``, one for each object of a mesh (:func:`read_solid`)."""
    solid = read_solid(link, X_UL, collision)
    if solid.mesh is None:
        return [solid]
    return [replace(solid, part=part) for part in range(len(obj_objects(solid.mesh)))]


def read_solid(link: str, X_UL: SE3, collision: Element) -> Solid:
    """Return the shape of a ``<collision>`` of a URDF whose file names are absolute.

    Raises:
        GeometryError: There is no shape, none that can be used, or its origin is malformed.
    """
    try:
        X_UG = X_UL @ urdf_origin(collision.find("origin"))
    except GeometryError as error:
        raise GeometryError(f"link {link!r}: <collision>: {error}") from None
    geometry = collision.find("geometry")
    shape = geometry[0] if geometry is not None and len(geometry) else None
    if shape is None:
        raise GeometryError(f"link {link!r}: a <collision> without a shape")
    if shape.tag in PRIMITIVES:
        return Solid(link, shape.tag, X_UG, sizes_of(link, shape))
    if shape.tag == "mesh":
        mesh = Path(shape.attrib["filename"])
        if mesh.suffix.lower() != ".obj" or not mesh.is_file():
            raise GeometryError(
                f"link {link!r}: its collision mesh has to be an OBJ file beside the URDF, found {mesh}"
            )
        return Solid(link, "mesh", X_UG, sizes_of(link, shape), mesh)
    raise GeometryError(f"link {link!r}: unsupported shape <{shape.tag}>; use box, cylinder, sphere or mesh")


def sizes_of(link: str, shape: Element) -> tuple[float, ...]:
    """Return what :attr:`Solid.size` holds of a shape: edges, radius and length [m], or the scale of a mesh.

    Raises:
        GeometryError: A number is missing or is none, a length is not above 0, or a scale is 0.
    """
    if shape.tag == "mesh":
        texts, wanted = shape.get("scale", "1 1 1").split(), "scale of three numbers other than 0"
        count = 3
    else:
        keys = DRAWN_PRIMITIVES[shape.tag]
        texts = " ".join(shape.get(key, "") for key in keys).split()
        count = 3 if keys == ("size",) else len(keys)
        wanted = "size of three edges above 0" if count == 3 else f"{' and '.join(keys)} above 0"
    try:
        sizes = tuple(map(float, texts))
    except ValueError:
        sizes = ()
    good = all(math.isfinite(a) and (a > 0.0 or (shape.tag == "mesh" and a != 0.0)) for a in sizes)
    if len(sizes) != count or not good:
        raise GeometryError(f"link {link!r}: a <{shape.tag}> needs a {wanted}, found {' '.join(texts)!r}")
    return sizes


def convex_hull(points: Array) -> Array:
    """Return the convex hull of ``points``, shape (N, 2) [m], as its vertices counter-clockwise.

    The first vertex is the leftmost, the upper one of two.

    Raises:
        GeometryError: All points are on one line.
    """
    hull = hull_or_line(points)
    if len(hull) < 3:
        raise GeometryError(f"the convex hull of {len(points)} points on one line has no area")
    return hull


def hull_or_line(points: Array) -> Array:
    """Return the hull of two points or more as :func:`convex_hull` does, or the two ends of points on a line.

    Andrew's monotone chain. To import SciPy's hull takes longer than all that a check of a scene computes.
    """
    points = _without_inner(points) if len(points) >= _MANY else points
    rightwards = points[np.lexsort((-points[:, 1], points[:, 0]))].tolist()
    turns = [*_lower_chain(rightwards)[:-1], *_lower_chain(rightwards[::-1])[:-1]]
    # What is flat is left out afterwards: the order along x says nothing of points on an upright edge.
    corners: list[list[float]] = []
    for point in (*turns, turns[0]):
        while len(corners) > 1 and _is_on_edge(corners[-2], corners[-1], point):
            corners.pop()
        corners.append(point)
    corners.pop()
    while len(corners) > 2 and _is_on_edge(corners[-1], corners[0], corners[1]):
        del corners[0]
    return np.array(corners)


def _without_inner(points: Array) -> Array:
    """Return the points without those inside the polygon of the outermost ones in some directions."""
    outermost = points[np.argmax(points @ _OUTWARDS, axis=0)]
    outermost = outermost[(outermost != np.roll(outermost, 1, axis=0)).any(axis=1)]
    if len(outermost) < 3:
        return points
    along = np.roll(outermost, -1, axis=0) - outermost
    leftwards = np.stack([-along[:, 1], along[:, 0]])
    inner = (points @ leftwards - (outermost * leftwards.T).sum(axis=1) > _FLAT_M2).all(axis=1)
    outer: Array = points[~inner]
    return outer


def _lower_chain(points: list[list[float]]) -> list[list[float]]:
    """Return those of the points, ordered along an axis, at which a hull turns left from first to last."""
    chain: list[list[float]] = []
    for point in points:
        x, y = point
        while len(chain) > 1:
            ax, ay = chain[-2]
            bx, by = chain[-1]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                break
            chain.pop()
        chain.append(point)
    return chain


def _is_on_edge(a: list[float], b: list[float], c: list[float]) -> bool:
    """Return whether a hull that turns left from ``a`` over ``b`` to ``c`` has no corner at ``b``."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - b[0], c[1] - b[1]
    return ux * vy - uy * vx <= _FLAT_M2 and ux * vx + uy * vy >= 0.0


def _circle() -> Array:
    t = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
    return np.stack([np.cos(t), np.sin(t)], axis=1)
