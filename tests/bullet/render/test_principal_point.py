"""A principal point beside the middle of the image moves the image, in every renderer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.render import RenderContext, build_renderer
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.pinhole import Window, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.spec import Choice


@pytest.mark.parametrize(("name", "tolerance"), [("raster", 0), ("tiny", 2)])
def test_an_offset_of_whole_pixels_is_another_window(name: str, tolerance: int, tmp_path: Path) -> None:
    """To TinyRenderer's rounding of its projection; the rasteriser is exact."""
    scene = load_scene("close_range")
    placement = Placement({"a": SE2(-0.3, 0.05, -0.1), "b": SE2(0.4, 0.0, 0.0)}, {})
    camera = scene.cameras.onboard.pinhole
    with BulletWorld(scene, placement, tags=TagVisuals(scene, tmp_path)) as world:
        renderer = build_renderer(Choice(name=name), RenderContext(world.client, 2))
        X_WC = world.pose3("a") @ optical_pose(scene.geometry("a").frame("camera"))
        moved = renderer.render(replace(camera, offset=(8.0, -3.0)), X_WC, Window(250, 150, 128, 96))
        plain = renderer.render(camera, X_WC, Window(242, 153, 128, 96))
    assert np.ptp(plain) > 100
    different = np.abs(moved.astype(int) - plain.astype(int)) > tolerance
    assert different.mean() < (0.01 if tolerance else 1e-9)
