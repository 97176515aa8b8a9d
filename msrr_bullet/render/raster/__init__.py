"""A rasteriser of textured triangle meshes with exact visibility (``docs/explanation/renderer.md``).

Its modules import numba, which costs time and memory; a scene that names another renderer does not load them.
"""
