"""Who takes part in a comparison of renderers, and the worlds that they draw."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

import pybullet

from msrr_bullet.render.renderer import RenderContext, Renderer, build_renderer
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice

#: Renderers that are compared: label -> (registered name, TinyRenderer's samples per pixel edge).
CONTESTANTS: Mapping[str, tuple[str, int]] = MappingProxyType(
    {"tiny 1x": ("tiny", 1), "tiny 2x": ("tiny", 2), "tiny 4x": ("tiny", 4), "raster": ("raster", 1)}
)

#: The one that a pixel is compared with.
REFERENCE = ("tiny", 8)


def contestants(client: int) -> dict[str, Renderer]:
    """Return the renderers that are compared, by label, for the bodies of a client."""
    return {label: build_contestant(client, *spec) for label, spec in CONTESTANTS.items()}


def build_contestant(client: int, name: str, samples: int) -> Renderer:
    """Return the renderer registered as ``name`` for the bodies of a client."""
    return build_renderer(Choice(name=name), RenderContext(client, samples))


@contextmanager
def bare_client() -> Iterator[tuple[int, Path]]:
    """Open an empty PyBullet client and a folder for its files; both go at the end."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        with tempfile.TemporaryDirectory(prefix="msrr-") as folder:
            yield client, Path(folder)
    finally:
        pybullet.disconnect(physicsClientId=client)


@contextmanager
def facing_units(X_DU: SE2) -> Iterator[tuple[Scene, BulletWorld]]:
    """Open the world of scene ``close_range`` with its unit a at ``X_DU`` before b's rear port."""
    scene = load_scene("close_range")
    X_WD = scene.units["b"].pose.nominal @ scene.geometry("b").dock_frame("rear")
    placement = Placement({"b": scene.units["b"].pose.nominal, "a": X_WD @ X_DU}, {})
    with tempfile.TemporaryDirectory(prefix="msrr-") as folder:
        tags = TagVisuals(scene, Path(folder))
        with BulletWorld(scene, placement, tags=tags) as world:
            yield scene, world
