"""msrr_bullet.render.raster.kernels."""
