"""A visible shape on a moving frame."""

from __future__ import annotations

from dataclasses import dataclass

from msrr_bullet.render.raster.mesh import Mesh
from msrr_bullet.render.raster.texture import Texture
from msrr_scenes.geometry.se3 import SE3


@dataclass(frozen=True, eq=False)
class VisualShape:
    """One visible shape.

    Attributes:
        mover: Number of the mover that carries it, a frame M.
        X_MG: The mesh's own frame in M.
        mesh: In metres.
        grey: Reflectance, 0 to 1.
        texture: Picture on it, which multiplies ``grey``, or None.
    """

    mover: int
    X_MG: SE3
    mesh: Mesh
    grey: float
    texture: Texture | None = None
