"""Renderers compute the noise-free pixels of any window of a camera's image from the simulated world.

A renderer of your own is a class with the method of :class:`Renderer`, built from a :class:`RenderContext`; a
scene names it by its import path.
"""

from msrr_bullet.render.renderer import ExposureRenderer, Instant, RenderContext, Renderer
from msrr_bullet.render.renderer_registry import RENDERERS, build_renderer

__all__ = [
    "RENDERERS",
    "ExposureRenderer",
    "Instant",
    "RenderContext",
    "Renderer",
    "build_renderer",
]
