"""Both renderers over dressed scenes: units and obstacles in their colours, with tags, for both cameras."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from msrr_bullet.render import RenderContext
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.render.tiny_renderer import TinyRenderer
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_perception.pose.global_pose import overhead_pose
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene

#: Difference by which a pixel is off [grey levels]: more than rounding, less than the contrast of a tag.
OFF = 20

CRATE = {"shape": "box", "length_m": 0.16, "width_m": 0.14, "height_m": 0.12, "tag_id": 500}
POST = {"shape": "cylinder", "radius_m": 0.06, "height_m": 0.15, "tag_id": 501}
SCENE = {
    "name": "dressed",
    "units": {name: {"number": i} for i, name in enumerate("abc")},
    "faults": [{"kind": "marker_hidden", "unit": "c"}],
    "cameras": {"overhead": {"height_m": 1.5}},
    "plan": [{"unit": "a", "to": "b.rear"}],
}


def dressed(folder: Path, gap: float, cylinder: bool) -> tuple[Scene, BulletWorld]:
    """Unit a in front of b at a distance of the ports [m], c and the obstacles around them."""
    obstacles = {"crate": CRATE, **({"post": POST} if cylinder else {})}
    scene = Scene.model_validate({**SCENE, "obstacles": obstacles})
    X_WB = SE2(0.3, 0.05, 0.3)
    X_DP = SE2(-gap, 0.2 * gap, -0.2)
    X_WA = X_WB @ scene.geometry("b").dock_frame("rear") @ X_DP @ scene.geometry("a").port("front").inverse()
    places = {"crate": X_WA @ SE2(0.55, -0.3, 0.5), "post": X_WA @ SE2(0.5, 0.28, 0.2)}
    units = {"a": X_WA, "b": X_WB, "c": X_WA @ SE2(0.9, 0.3, 2.0)}
    placement = Placement(units, {name: places[name] for name in obstacles})
    return scene, BulletWorld(scene, placement, tags=TagVisuals(scene, folder))


def views(scene: Scene, world: BulletWorld) -> Iterator[tuple[PinholeCamera, SE3, Window]]:
    """What both cameras see; of the overhead picture the part with the bodies."""
    onboard, overhead = scene.cameras.onboard.pinhole, scene.cameras.overhead
    yield onboard, optical_pose(world.link_pose("a", "camera")), onboard.frame
    assert overhead is not None
    yield overhead.pinhole, overhead_pose(overhead), Window(320, 240, 640, 480)


def shares_off(scene: Scene, world: BulletWorld) -> list[float]:
    """Return, for both cameras, the share of the pixels of bodies at which the two renderers differ."""
    shares = []
    context = RenderContext(world.client, samples=2)
    for camera, X_WC, window in views(scene, world):
        pictures: list[NDArray[np.int64]] = [
            renderer.render(camera, X_WC, window).astype(np.int64)
            for renderer in (RasterRenderer(context), TinyRenderer(context))
        ]
        floor = context.floor.image(camera, X_WC, window)
        body = np.max([np.abs(picture - floor) for picture in pictures], axis=0) > OFF
        assert body.mean() > 0.03, "there is something to compare"
        shares.append(float(((np.abs(pictures[0] - pictures[1]) > OFF) & body).sum() / body.sum()))
    return shares


@pytest.mark.parametrize("gap", [0.06, 0.25, 0.6])
def test_both_renderers_see_dressed_scenes_alike(gap: float, tmp_path: Path) -> None:
    """What remains are edges, which TinyRenderer does not sample as finely."""
    scene, world = dressed(tmp_path, gap, cylinder=False)
    with world:
        assert max(shares_off(scene, world)) < 0.03


def test_only_tinyrenderers_shading_of_cylinders_differs(tmp_path: Path) -> None:
    scene, world = dressed(tmp_path, 0.25, cylinder=True)
    with world:
        assert max(shares_off(scene, world)) < 0.12


def test_a_tag_leaves_the_colours_of_its_unit_alone(tmp_path: Path) -> None:
    """A lit face of the deck is as grey as the URDF says (0.5), not white."""
    _, world = dressed(tmp_path, 0.25, cylinder=False)
    camera = PinholeCamera(64, 48, 300.0)
    over_the_deck = SE3(np.diag([1.0, -1.0, -1.0]), np.array([-0.06, 0.05, 0.155]))
    lit = 0.6 + 0.4 * 0.86 / math.hypot(0.45, 0.25, 0.86)
    with world:
        context = RenderContext(world.client, samples=1)
        X_WC = world.pose3("a") @ over_the_deck
        for renderer in (RasterRenderer(context), TinyRenderer(context)):
            image = renderer.render(camera, X_WC, camera.frame)
            assert np.median(image) == pytest.approx(255.0 * 0.5 * lit, abs=3.0)
