"""The renderers that ship with the project, by name, and their compilation ahead of a trial."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from msrr_bullet.render.renderer import RenderContext, Renderer
from msrr_scenes.geometry.distortion import COEFFICIENTS
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.guarded import wrong
from msrr_scenes.messages import Pixels
from msrr_scenes.registry import ExtensionPoint, build
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice


def _tiny(context: RenderContext, **params: Literal["composited", "mesh"]) -> Renderer:
    from msrr_bullet.render.tiny_renderer import TinyRenderer

    return TinyRenderer(context, **params)


def _raster(context: RenderContext, **params: Any) -> Renderer:
    from msrr_bullet.render.raster_renderer import RasterRenderer

    return RasterRenderer(context, **params)


def _image(result: object, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
    """Return the pixels of a class of a user's own; a ValueError says what is wrong with them."""
    if not isinstance(result, np.ndarray):
        wrong(result, "an array of pixels")
    if result.dtype != np.uint8 or result.shape != (window.height, window.width):
        found = f"an array of {result.dtype} of shape {result.shape}"
        raise ValueError(f"{found}; expected uint8 of shape {(window.height, window.width)}")
    return result


#: Renderers by name. Each is imported when a scene asks for it.
RENDERERS: ExtensionPoint[Renderer] = ExtensionPoint(
    {"tiny": _tiny, "raster": _raster}, methods={"render": _image}
)


def build_renderer(choice: Choice, context: RenderContext) -> Renderer:
    """Build the renderer that a scene names: ``factory(context, **choice.params)``.

    Raises:
        UnknownNameError: The name is neither registered nor the import path of a class.
        SceneError: The renderer does not take the scene's parameters.
    """
    return build("renderer", choice, RENDERERS, context)


def prepare_renderers(scene: Scene, announce: Callable[[str], None]) -> None:
    """Compile the kernels that perception and the cameras of ``scene`` need, unless they are on disk already.

    Args:
        scene: Scene whose cameras name the renderers.
        announce: Called with a message before a compilation begins.
    """
    from msrr_perception.kernels.warm import warm

    warm(announce)
    cameras = [scene.cameras.onboard, *([scene.cameras.overhead] if scene.cameras.overhead else [])]
    if scene.perception == "images" and any(c.renderer.name == "raster" for c in cameras):
        from msrr_bullet.render.raster.rasterizer import compile_kernels

        errors = scene.as_built.onboard, scene.as_built.overhead
        deviations = [getattr(error, key) for error in errors for key in COEFFICIENTS]
        distorted = any(camera.lens.distorts for camera in cameras)
        compile_kernels(announce, lens=distorted or any(k.error or k.sigma for k in deviations))
