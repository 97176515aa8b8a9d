"""Shapes of the page."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.viewer.shapes import band, extrusion


def test_a_band_has_its_width():
    geometry = band([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 2.0]], 0.1, 0.02)
    a, b, c = (geometry.vertices[geometry.faces[:, i]].astype(float) for i in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert areas.sum() == pytest.approx(0.1 * (1.1 + 2.1), rel=1e-6)
    assert np.isfinite(geometry.vertices).all()


def test_an_extrusion_has_walls_and_a_top():
    geometry = extrusion([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], 0.5)
    a, b, c = (geometry.vertices[geometry.faces[:, i]].astype(float) for i in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert areas.sum() == pytest.approx(1.0 + 4 * 0.499, rel=1e-6)
    assert geometry.vertices[:, 2].max() == pytest.approx(0.5)
