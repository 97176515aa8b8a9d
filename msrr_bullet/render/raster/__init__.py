"""The raster renderer: a rasteriser of our own for any triangle mesh; see ``docs/renderer.md``.

Importing it imports numba, which costs time and memory; a scene that names another renderer does neither.
"""

from msrr_bullet.render.raster.kernels.warm import warm
from msrr_bullet.render.raster.renderer import RasterRenderer

__all__ = ["RasterRenderer", "warm"]
