"""Pictures that are kept: they are those that a new renderer draws, and what has not changed is not drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from msrr_bullet.render import Instant, RenderContext
from msrr_bullet.render.raster.rasterizer import Rasterizer
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels
from tests.bullet.render.conftest import add_box, place

CAMERA = PinholeCamera.from_hfov(320, 240, math.radians(75.0))
X_OVERHEAD = SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 2.0]))
WINDOW = Window(130, 90, 60, 60)


@pytest.mark.parametrize("lens", [None, Distortion(k1=-0.08, p1=0.002)], ids=str)
def test_every_picture_is_that_of_a_new_renderer(client: int, lens: Distortion | None) -> None:
    """Boxes that jump, creep or stay: into a window, out of it, across its edge, up to the camera."""
    rng = np.random.default_rng(5)
    windows = (WINDOW, Window(-4, 60, 70, 50), Window(250, 170, 70, 70))
    boxes = [add_box([0.3, 0.2, 0.1], SE3(), grey=grey) for grey in (0.3, 0.6, 0.9)]
    poses = [np.array([*rng.uniform(-1.0, 1.0, 2), 0.5, 0.0]) for _ in boxes]
    context = RenderContext(client)
    renderer = RasterRenderer(context)

    def seen_by(renderer: RasterRenderer, window: Window) -> Pixels:
        return renderer.render_instants(CAMERA, [(window, Instant(X_OVERHEAD))], lens)[0]

    for step in range(100):
        k = step % 4
        if k < len(boxes):
            poses[k] = poses[k] + rng.choice([1e-4, 0.02, 0.4]) * rng.normal(size=4)
            x, y, z, yaw = poses[k]
            place(boxes[k], SE3.from_xyz_rpy([x, y, z], [0.0, 0.0, yaw]))
        new = RasterRenderer(context)
        for window in windows:
            np.testing.assert_array_equal(seen_by(renderer, window), seen_by(new, window))


def test_only_what_changes_in_the_window_is_drawn_again(client: int, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Window] = []
    draw = Rasterizer.draw

    def note(self: Rasterizer, camera: PinholeCamera, X_WC: SE3, window: Window, *rest: Any) -> Pixels:
        drawn.append(window)
        return draw(self, camera, X_WC, window, *rest)

    monkeypatch.setattr(Rasterizer, "draw", note)
    near, far = (add_box([0.2, 0.2, 0.1], SE3(p=np.array([x, 0.0, 0.1]))) for x in (0.0, 1.0))
    renderer = RasterRenderer(RenderContext(client))

    def is_drawn(
        camera: PinholeCamera = CAMERA,
        X_WC: SE3 = X_OVERHEAD,
        window: Window = WINDOW,
        lens: Distortion | None = None,
        displaced: Mapping[int, SE3] | None = None,
    ) -> bool:
        drawn.clear()
        renderer.render_instants(camera, [(window, Instant(X_WC, displaced or {}))], lens)
        return bool(drawn)

    assert is_drawn()
    assert not is_drawn()
    place(far, SE3(p=np.array([1.0, 0.1, 0.1])))
    assert not is_drawn(), "what moves is not in the window"
    assert not is_drawn(displaced={far: SE3(p=np.array([0.0, 0.1, 0.0]))}), "nor is what is displaced"
    assert is_drawn(displaced={near: SE3(p=np.array([0.0, 0.1, 0.0]))}), "what is displaced is in the window"
    assert is_drawn()
    assert is_drawn(lens=Distortion(k1=-0.1)), "another lens"
    assert not is_drawn(lens=Distortion(k1=-0.1))
    assert is_drawn(window=Window(130, 90, 60, 61)), "another window"
    assert is_drawn(X_WC=SE3(X_OVERHEAD.R, np.array([0.0, 0.0, 2.1]))), "the camera has moved"
    assert is_drawn(camera=PinholeCamera(320, 240, CAMERA.focal + 1.0), X_WC=X_OVERHEAD), "another camera"
    assert is_drawn()
    place(near, SE3(p=np.array([1e-12, 0.0, 0.1])))
    assert is_drawn(), "a body in the window has moved"
    place(far, SE3(p=np.array([0.3, 0.0, 0.1])))
    assert is_drawn(), "a body has come"
    assert not is_drawn()
    place(far, SE3(p=np.array([1.0, 0.0, 0.1])))
    assert is_drawn(), "a body has gone"
    add_box([0.1, 0.1, 0.1], SE3(p=np.array([0.0, 0.0, 0.4])))
    assert is_drawn(), "a body was added"


def test_a_body_that_the_lens_alone_moves_into_the_window_is_drawn(client: int) -> None:
    lens, window = Distortion(k1=-0.1), Window(300, 220, 10, 10)
    ideal = lens.ideal_pixels(CAMERA, np.array([[304.0, 224.0]]))[0]
    assert (ideal > [window.x_end + 3, window.y_end + 3]).all(), "an ideal lens shows it elsewhere"
    there = SE3(p=X_OVERHEAD.act(1.9 * CAMERA.rays(ideal)))
    speck = add_box([0.01, 0.01, 0.01], SE3(p=np.array([0.0, 0.0, 0.1])))
    renderer = RasterRenderer(RenderContext(client))
    pictures = []
    for X_WB in (SE3(p=np.array([0.0, 0.0, 0.1])), there):
        place(speck, X_WB)
        pictures += renderer.render_instants(CAMERA, [(window, Instant(X_OVERHEAD))], lens)
    assert (pictures[0] != pictures[1]).any()
