"""The pose of an assembled unit follows from the unit that it is locked to, for every start."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from msrr_scenes import load_scene
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.placement.start_regions import outline, region
from msrr_scenes.random_streams import stream


@pytest.mark.parametrize("seed", range(4))
def test_every_unit_stands_in_its_seat_and_inside_its_start_region(seed: int) -> None:
    scene = load_scene("reconfigure")
    units = draw_placement(scene, partial(stream, seed)).units
    for dock in scene.assembled_docks:
        X_WD = units[dock.target_unit] @ scene.geometry(dock.target_unit).dock_frame(dock.target_port)
        X_DP = X_WD.inverse() @ units[dock.unit] @ scene.geometry(dock.unit).port(dock.port)
        assert max(abs(X_DP.x), abs(X_DP.y), abs(X_DP.yaw)) < 1e-9
        body = outline(scene, dock.unit)
        covered = region(scene, dock.unit, body)
        stands = units[dock.unit].act(body)
        assert np.all(stands.min(axis=0) >= covered.min(axis=0) - 1e-9)
        assert np.all(stands.max(axis=0) <= covered.max(axis=0) + 1e-9)


def test_the_whole_assembly_follows_the_root() -> None:
    scene = load_scene("reconfigure")
    first, second = (draw_placement(scene, partial(stream, seed)).units for seed in (1, 2))
    assert first["a"] != second["a"]
    for unit in scene.units:
        a, b = (units["a"].inverse() @ units[unit] for units in (first, second))
        assert np.allclose(a.as_array(), b.as_array(), atol=1e-9)
