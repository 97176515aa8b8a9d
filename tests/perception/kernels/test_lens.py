"""The lens as kernels take it is that of the scenes."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.kernels.compiled import kernel
from msrr_perception.kernels.lens import Optic, distorted, optic_of, undistort
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera

CAMERA = PinholeCamera(640, 480, 417.0, (6.5, -5.5))
LENSES = [
    Distortion(aspect=0.97),
    Distortion(-0.2, 0.04, 0.002, -0.001, 0.0, 1.02),
    Distortion(0.2, -0.03, -0.003, 0.002, 0.004),
]


@kernel
def bent(optic: Optic, pixels: Array) -> Array:
    out = np.empty_like(pixels)
    for i in range(len(pixels)):
        out[i, 0], out[i, 1] = distorted(optic, pixels[i, 0], pixels[i, 1])
    return out


@pytest.mark.parametrize("distortion", LENSES, ids=str)
def test_pixels_are_those_of_the_lens(distortion: Distortion) -> None:
    lens = Lens(CAMERA, distortion)
    shown = np.random.default_rng(1).uniform(0.0, [640.0, 480.0], (200, 2))
    ideal = undistort(optic_of(lens), shown)
    np.testing.assert_allclose(ideal, lens.undistorted(shown), atol=1e-6)
    np.testing.assert_allclose(bent(optic_of(lens), ideal), shown, atol=1e-6)
    np.testing.assert_allclose(bent(optic_of(lens), ideal), lens.distorted(ideal), atol=1e-9)


def test_what_the_lens_shows_nowhere_is_not_found() -> None:
    """With k1 = -0.2 nothing is shown beyond 0.86 focal lengths, 359 px, from the principal point."""
    optic = optic_of(Lens(CAMERA, Distortion(k1=-0.2)))
    to_side = np.array([[CAMERA.cx + r, CAMERA.cy] for r in (350.0, 365.0)])
    assert np.isfinite(undistort(optic, to_side)).tolist() == [[True, True], [False, False]]
