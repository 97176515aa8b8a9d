"""The renderer protocol, what a renderer is given, and the renderers that ship with the project."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, Protocol

from msrr_bullet.render.floor import Floor, concrete_floor
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels
from msrr_scenes.registry import build
from msrr_scenes.specs.spec import Choice


class Renderer(Protocol):
    """Turns the world as it stands into pixels."""

    def render(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
        """Return the noise-free mono8 pixels of ``window``, shape (height, width).

        The window may reach outside the frame (the lens blur of a border pixel needs its neighbours); those
        pixels are the scene continued. A window's pixels are the crop of any larger window's.
        """
        ...


@dataclass(frozen=True, slots=True)
class RenderContext:
    """What a renderer is built from.

    Attributes:
        client: PyBullet client whose bodies are seen.
        samples: Edge of the sub-pixel grid that is averaged over (1: no anti-aliasing).
        floor: The floor and the wall behind it.
    """

    client: int
    samples: int = 2
    floor: Floor = field(default_factory=concrete_floor)


def _tiny(context: RenderContext, **params: Literal["composited", "mesh"]) -> Renderer:
    from msrr_bullet.render.tiny import TinyRenderer

    return TinyRenderer(context, **params)


def _raster(context: RenderContext, **params: Any) -> Renderer:
    from msrr_bullet.render.raster import RasterRenderer

    return RasterRenderer(context, **params)


#: Renderers by name; one of your own is named by its import path and built from a RenderContext as well.
RENDERERS: Mapping[str, Callable[..., Renderer]] = MappingProxyType({"tiny": _tiny, "raster": _raster})


def build_renderer(choice: Choice, context: RenderContext) -> Renderer:
    """Build the renderer a scene names: ``factory(context, **choice.params)``.

    Raises:
        UnknownNameError: Neither a registered name nor an import path that leads anywhere.
        SceneError: The renderer does not take the scene's parameters.
    """
    return build("renderer", choice, RENDERERS, context)
