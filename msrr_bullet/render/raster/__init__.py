"""The raster renderer: a rasteriser of our own for any triangle mesh; see ``docs/renderer.md``.

Importing it imports numba, which costs time and memory; a scene that names another renderer does neither.
"""

from msrr_bullet.render.raster.renderer import RasterRenderer
from msrr_bullet.render.raster.warm import warm

__all__ = ["RasterRenderer", "warm"]
