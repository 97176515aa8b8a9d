"""The renderers that ship with the project, by name, and their compilation ahead of a trial."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Literal

from msrr_bullet.render.renderer import RenderContext, Renderer
from msrr_scenes.registry import build
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice


def _tiny(context: RenderContext, **params: Literal["composited", "mesh"]) -> Renderer:
    from msrr_bullet.render.tiny_renderer import TinyRenderer

    return TinyRenderer(context, **params)


def _raster(context: RenderContext, **params: Any) -> Renderer:
    from msrr_bullet.render.raster_renderer import RasterRenderer

    return RasterRenderer(context, **params)


#: Renderers by name. Each is imported when a scene asks for it.
RENDERERS: Mapping[str, Callable[..., Renderer]] = MappingProxyType({"tiny": _tiny, "raster": _raster})


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

        compile_kernels(announce)
