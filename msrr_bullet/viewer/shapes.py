"""Shapes in the page: solids of a URDF, tag plates, flat bands and sectors, extrusions, thin lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import cv2
import meshcat.geometry as g
import numpy as np
from numpy.typing import ArrayLike

from msrr_bullet.tag_print import plate_texture
from msrr_bullet.viewer.commands import Command, set_object, set_transform
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy
from msrr_scenes.geometry.solid import Solid
from msrr_scenes.specs.tag_families import TagFamily

#: From a URDF cylinder (axis z) to meshcat's (axis y).
_X_CYLINDER = SE3(rotation_from_rpy(math.pi / 2, 0.0, 0.0))
#: From a tag frame (z into the tag, y down) to the front of a box (z outwards, y up).
_X_FRONT = SE3(rotation_from_rpy(math.pi, 0.0, 0.0))

PLATE_THICKNESS = 0.001


def shaded_material(colour: int) -> g.Material:
    """Return a matt material that is shaded by the light, for bodies."""
    return g.MeshLambertMaterial(color=colour)


def flat_material(colour: int, opacity: float = 1.0) -> g.Material:
    """Return a material that shows exactly its colour in any light, for drawings."""
    return g.MeshBasicMaterial(color=colour, opacity=opacity, depthWrite=opacity == 1.0)


def solid(path: str, shape: Solid, material: g.Material) -> Iterator[Command]:
    """Draw the shape of a link or of an obstacle in its body's frame; all of a mesh with its first part."""
    if shape.part:
        return
    X_UG, scale = shape.X_UG, (1.0, 1.0, 1.0)
    if shape.kind == "box":
        geometry: g.Geometry = g.Box(list(shape.size))
    elif shape.kind == "cylinder":
        geometry, X_UG = g.Cylinder(shape.size[1], shape.size[0]), X_UG @ _X_CYLINDER
    elif shape.kind == "sphere":
        geometry = g.Sphere(shape.size[0])
    else:
        assert shape.mesh is not None
        geometry = g.ObjMeshGeometry.from_file(str(shape.mesh))
        scale = (shape.size[0], shape.size[1], shape.size[2])
    yield set_object(path, geometry, material)
    yield set_transform(path, X_UG, scale)


def tag_plate(path: str, X_BT: SE3, size: float, tag_id: int | None, family: TagFamily) -> Iterator[Command]:
    """Draw a tag of ``size`` [m] at frame T of body B, or a blank plate."""
    encoded, png = cv2.imencode(".png", plate_texture(tag_id, family))
    assert encoded
    texture = g.ImageTexture(image=g.PngImage(png.tobytes()))
    edge = family.plate_ratio * size
    yield set_object(path, g.Box([edge, edge, PLATE_THICKNESS]), g.MeshLambertMaterial(map=texture))
    yield set_transform(path, X_BT @ _X_FRONT)


def band(points: ArrayLike, width: float, z: float) -> g.Geometry:
    """Return a flat band of ``width`` [m] at height ``z`` [m] along ``points``, shape (N >= 2, 2) [m].

    Paths are bands because WebGL draws lines one pixel wide, whatever width is requested.
    """
    p = np.asarray(points, dtype=np.float64)
    a, b = p[:-1], p[1:]
    along = b - a
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = 0.5 * width * np.divide(along, length, out=np.zeros_like(along), where=length > 0.0)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    # Square ends that reach half a width beyond the point close the gaps at the bends.
    corners = np.stack([a - along + across, a - along - across, b + along - across, b + along + across], 1)
    vertices = np.column_stack([corners.reshape(-1, 2), np.full(4 * len(a), z)])
    first = 4 * np.arange(len(a))[:, None]
    faces = np.concatenate([first + np.array(triangle) for triangle in ((0, 1, 2), (0, 2, 3))])
    return g.TriangularMeshGeometry(vertices, faces)


def flat_band(
    path: str, points: Sequence[Any] | Array, width: float, z: float, colour: int, opacity: float = 1.0
) -> Iterator[Command]:
    """Draw a band, see :func:`band`, that shows exactly its colour; nothing through less than two points."""
    if len(points) > 1:
        yield set_object(path, band(points, width, z), flat_material(colour, opacity))


def sector(start: float, end: float, radius: float) -> g.Geometry:
    """Return a flat sector of a circle about the origin, from angle ``start`` to ``end`` [rad], at z = 0."""
    angles = np.linspace(start, end, 24)
    rim = radius * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    i = np.arange(1, len(angles))
    faces = np.stack([np.zeros_like(i), i, i + 1], axis=1)
    return g.TriangularMeshGeometry(np.concatenate([np.zeros((1, 3)), rim]), faces)


def extrusion(outline: ArrayLike, height: float) -> g.Geometry:
    """Return the walls and the top over a convex outline, shape (N, 2) [m]."""
    p = np.asarray(outline, dtype=np.float64)
    n = len(p)
    vertices = np.concatenate(
        [np.column_stack([p, np.full(n, 0.001)]), np.column_stack([p, np.full(n, height)])]
    )
    i, j = np.arange(n), (np.arange(n) + 1) % n
    walls = np.concatenate([np.stack([i, j, n + j], 1), np.stack([i, n + j, n + i], 1)])
    top = np.stack([np.full(n - 2, n), n + np.arange(1, n - 1), n + np.arange(2, n)], axis=1)
    return g.TriangularMeshGeometry(vertices, np.concatenate([walls, top]))


def line_segments(path: str, ends: ArrayLike, colour: int) -> Command:
    """Draw thin lines between consecutive pairs of points, shape (2 N, 3) [m]."""
    points = np.asarray(ends, dtype=np.float32).T
    return set_object(path, g.PointsGeometry(points), g.LineBasicMaterial(color=colour), g.LineSegments)
