"""The interface of a renderer, and what a renderer is built from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from msrr_bullet.render.floor import Floor, concrete_floor
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels

#: Nothing nearer to a camera is drawn, so that one may sit inside a body [m].
NEAR_M = 0.01

#: The light of the scene: where it comes from, and its share that reaches every surface, and that which
#: reaches what faces it.
TOWARDS_LIGHT, AMBIENT, DIFFUSE = (-0.45, 0.25, 0.86), 0.6, 0.4


class Renderer(Protocol):
    """Draws the simulated world as it stands when it is called, for one camera or for several in turns."""

    def render(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
        """Return the noise-free mono8 pixels of ``window``, shape (height, width).

        The window may reach outside the frame (the lens blur of a border pixel needs its neighbours); those
        pixels are the scene continued. A window's pixels are the crop of any larger window's.
        """
        ...


@dataclass(frozen=True, eq=False)
class Instant:
    """An instant shortly before or after that at which the world stands.

    Attributes:
        X_WC: Pose of the camera at that instant.
        displaced: Displacement, as a motion of points in W, of each body that is elsewhere, by PyBullet id.
    """

    X_WC: SE3
    displaced: Mapping[int, SE3] = field(default_factory=dict)


class ExposureRenderer(Renderer, Protocol):
    """A renderer that draws the instants of an exposure and the distortion of a lens, too."""

    def render_instants(
        self,
        camera: PinholeCamera,
        views: Sequence[tuple[Window, Instant]],
        distortion: Distortion | None = None,
    ) -> list[Pixels]:
        """Return the noise-free mono8 pixels of each window at its instant; see :class:`Renderer`.

        Args:
            camera: Intrinsics.
            views: Windows, each with its instant.
            distortion: Distortion of the lens; None for an ideal one.
        """
        ...


@dataclass(frozen=True, slots=True)
class RenderContext:
    """What a renderer is built from.

    Attributes:
        client: PyBullet client whose bodies are drawn.
        samples: Edge of the grid of samples per pixel (1: no anti-aliasing).
        floor: The floor and the wall behind it.
    """

    client: int
    samples: int = 2
    floor: Floor = field(default_factory=concrete_floor)
