"""What a world needs to know about tags: who draws them, and nothing of how."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from msrr_scenes.geometry.se2 import SE2


class Dressing(Protocol):
    """Puts tags on the units and obstacles of one scene."""

    def unit_urdf(self, unit: str) -> Path:
        """Return a copy of the unit's URDF that carries quads for its tags."""
        ...

    def dress_unit(self, client: int, body: int, unit: str) -> None:
        """Put the textures on the quads of a body loaded from :meth:`unit_urdf`."""
        ...

    def dress_obstacle(self, client: int, obstacle: str, X_WO: SE2) -> None:
        """Lay the tag on top of an obstacle that stands at ``X_WO``."""
        ...
