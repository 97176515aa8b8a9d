"""The texture of the floor for the kernels."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_bullet.render.raster.floor_texture import pack_floor
from msrr_scenes.errors import SceneError


def test_a_floor_that_is_no_pyramid_is_refused() -> None:
    level = np.zeros((4, 4), dtype=np.float32)
    with pytest.raises(SceneError, match="pyramid"):
        pack_floor((level, level), 1.0, 0.0)
    with pytest.raises(SceneError, match="outside 0 to 255"):
        pack_floor((np.full((1, 1), 300.0, dtype=np.float32),), 1.0, 0.0)


def test_a_texel_is_stored_with_its_neighbours_to_the_right_and_below() -> None:
    fine = np.arange(16, dtype=np.float32).reshape(4, 4)
    levels = (fine, np.full((2, 2), 7.0, dtype=np.float32), np.full((1, 1), 7.0, dtype=np.float32))
    packed = pack_floor(levels, period=2.0, wall=160.0)
    assert packed.per_metre == 2.0
    assert packed.bits.tolist() == [2, 2, 1, 1, 0]
    assert packed.start.tolist() == [0, 16, 32, 36, 40]
    bytes_of = packed.texels[:16].astype("<u4").view(np.uint8).reshape(4, 4, 4)
    right, below = np.roll(fine, -1, axis=1), np.roll(fine, -1, axis=0)
    diagonal = np.roll(right, -1, axis=0)
    np.testing.assert_array_equal(bytes_of, np.stack([fine, right, below, diagonal], axis=-1))
