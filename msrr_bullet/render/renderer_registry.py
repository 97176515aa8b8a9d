"""The renderers that ship with the project, by name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from msrr_bullet.render.renderer import Instant, RenderContext, Renderer
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.guarded import wrong
from msrr_scenes.messages import Pixels
from msrr_scenes.registry import ExtensionPoint, build
from msrr_scenes.specs.spec import Choice


def _tiny(context: RenderContext, floor: Literal["composited", "mesh"] = "composited") -> Renderer:
    from msrr_bullet.render.tiny_renderer import TinyRenderer

    return TinyRenderer(context, floor)


def _raster(context: RenderContext) -> Renderer:
    from msrr_bullet.render.raster_renderer import RasterRenderer

    return RasterRenderer(context)


def _image(result: object, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
    """Return the pixels of a class of a user's own; a ValueError says what is wrong with them."""
    if type(result) is not np.ndarray:  # a matrix multiplies otherwise, and a mask would be ignored
        wrong(result, "a plain array of pixels")
    if result.dtype != np.uint8 or result.shape != (window.height, window.width):
        found = f"an array of {result.dtype} of shape {result.shape}"
        raise ValueError(f"{found}; expected uint8 of shape {(window.height, window.width)}")
    return result


def _images(
    result: object, camera: PinholeCamera, views: Sequence[tuple[Window, Instant]], *_: object
) -> list[Pixels]:
    """Return the pixels of each window of a class of a user's own; a ValueError says what is wrong."""
    if not isinstance(result, list | tuple) or len(result) != len(views):
        wrong(result, f"a list of {len(views)} images, one for each window")
    return [
        _image(pixels, camera, at.X_WC, window) for pixels, (window, at) in zip(result, views, strict=True)
    ]


#: Renderers by name. Each is imported when a scene asks for it.
RENDERERS: ExtensionPoint[Renderer] = ExtensionPoint(
    "renderer",
    {"tiny": _tiny, "raster": _raster},
    methods={"render": _image},
    optional={"render_instants": _images},
)


def build_renderer(choice: Choice, context: RenderContext, key: str = "cameras.onboard.renderer") -> Renderer:
    """Build the renderer that a scene names: ``factory(context, **choice.params)``.

    Raises:
        UnknownNameError: The name is neither registered nor the import path of a class.
        SceneError: The renderer does not take the scene's parameters.
    """
    return build(key, choice, RENDERERS, context)
