"""Makes compiled code ready before the first frame, or before a pool of workers would do it at once."""

from __future__ import annotations

from collections.abc import Callable

from msrr_bullet.pybullet_client import load_simulator
from msrr_perception.kernels.warm import warm as warm_perception
from msrr_scenes.specs.scene import Scene


def prepare_renderers(scene: Scene, announce: Callable[[str], None]) -> None:
    """Compile what perception and the cameras of ``scene`` need, unless it lies compiled on disk.

    Args:
        scene: Names the renderers.
        announce: Is told in words before a compilation begins.
    """
    warm_perception(announce)
    cameras = [scene.cameras.onboard, *([scene.cameras.overhead] if scene.cameras.overhead else [])]
    if scene.perception == "images" and any(c.renderer.name == "raster" for c in cameras):
        load_simulator()  # before the renderer imports it with its banner
        from msrr_bullet.render.raster.kernels.warm import warm

        warm(announce)
