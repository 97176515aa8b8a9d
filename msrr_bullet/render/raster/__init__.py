"""The raster renderer: a rasteriser of our own for any triangle mesh; see docs/renderer.md."""
