"""Primitive shapes as meshes, and meshes that are scaled."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from msrr_bullet.render.raster.mesh import cylinder


def test_a_round_body_is_as_wide_as_it_should_be() -> None:
    for radius in (0.005, 0.033, 0.5):
        vertices = cylinder(radius, 0.1).vertices
        np.testing.assert_allclose(np.abs(vertices[:, :2]).max(axis=0), radius)
        hull = ConvexHull(vertices[:, :2])
        distance = -hull.equations[:, 2].max()
        assert distance > radius - max(1e-4, 0.005 * radius)


def test_a_mirrored_mesh_keeps_its_outside_outside() -> None:
    mirrored = cylinder(0.05, 0.2).scaled(np.array([1.0, -2.0, 1.0]))
    corners = mirrored.vertices[mirrored.triangles]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ta,ta->t", corners.mean(axis=1), outward) > 0.0).all()
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert mirrored.normals is not None
    assert (np.einsum("tka,ta->tk", mirrored.normals, outward) > 0.9).all()
