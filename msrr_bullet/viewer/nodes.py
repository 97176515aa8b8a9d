"""Where a node of the page's scene is at an instant."""

from __future__ import annotations

from dataclasses import dataclass, field

from msrr_scenes.geometry.se3 import SE3


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Where a node is at an instant, whether it shows, and how far it is stretched."""

    X: SE3 = field(default_factory=SE3)
    visible: bool = True
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


HIDDEN = Placement(visible=False)
