"""A rasteriser of textured triangle meshes with exact visibility (``docs/explanation/renderer.md``).

Its kernels load numba when they are first called, which costs time and memory; a scene that names another
renderer does not load this package.
"""
