"""The renderers that are compared, and the worlds that they draw.

Clutter is boxes and tags that pierce each other, in front of a camera at any angle. All of it stands above
the floor, where all renderers agree on what is seen.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from msrr_bullet.render import RenderContext, Renderer, build_renderer
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.tag_plates import load_tag_plate
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.loading.load import load_scene
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice

#: Renderers that are compared: label -> (registered name, TinyRenderer's samples per pixel edge).
CANDIDATES: Mapping[str, tuple[str, int]] = {
    "tiny 1x": ("tiny", 1),
    "tiny 2x": ("tiny", 2),
    "tiny 4x": ("tiny", 4),
    "raster": ("raster", 1),
}

#: Renderer that the pixels are compared with.
REFERENCE = ("tiny", 8)

#: Middle of the clutter in W [m].
_MIDDLE = np.array([0.0, 0.0, 0.5])


def build_candidates(client: int) -> dict[str, Renderer]:
    """Return the renderers that are compared, by label, for the bodies of a client."""
    return {label: build_candidate(client, *spec) for label, spec in CANDIDATES.items()}


def build_candidate(client: int, name: str, samples: int) -> Renderer:
    """Return the renderer registered as ``name`` for the bodies of a client."""
    return build_renderer(Choice(name=name), RenderContext(client, samples))


@contextmanager
def empty_client() -> Iterator[tuple[int, Path]]:
    """Open an empty PyBullet client and a folder for its files; both are removed at the end."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        with tempfile.TemporaryDirectory(prefix="msrr-") as folder:
            yield client, Path(folder)
    finally:
        pybullet.disconnect(physicsClientId=client)


@contextmanager
def facing_units(X_DU: SE2) -> Iterator[tuple[Scene, BulletWorld]]:
    """Open the world of ``close_range``, as designed, with unit a at ``X_DU`` before the rear port of b."""
    scene = load_scene("close_range", {"as_built": "perfect"})
    X_WD = scene.units["b"].pose.nominal @ scene.geometry("b").dock_frame("rear")
    placement = Placement({"b": scene.units["b"].pose.nominal, "a": X_WD @ X_DU}, {})
    with tempfile.TemporaryDirectory(prefix="msrr-") as folder:
        tags = TagVisuals(scene, Path(folder))
        with BulletWorld(scene, placement, tags=tags) as world:
            yield scene, world


def add_clutter(client: int, rng: np.random.Generator, folder: Path) -> None:
    """Load eight massless boxes and four tag plates at random poses within 0.3 m of one point.

    The boxes are 4 to 30 cm long, the tags 5 to 15 cm wide. PyBullet reads the files of the plates from the
    folder.
    """
    for _ in range(8):
        grey = rng.uniform(0.1, 0.95)
        shape = pybullet.createVisualShape(
            pybullet.GEOM_BOX,
            halfExtents=rng.uniform(0.02, 0.15, 3).tolist(),
            rgbaColor=[grey, grey, grey, 1.0],
            physicsClientId=client,
        )
        quaternion = rng.standard_normal(4)
        pybullet.createMultiBody(
            baseMass=0.0,
            baseVisualShapeIndex=shape,
            basePosition=(_MIDDLE + rng.uniform([-0.3, -0.3, -0.2], [0.3, 0.3, 0.2])).tolist(),
            baseOrientation=(quaternion / np.linalg.norm(quaternion)).tolist(),
            physicsClientId=client,
        )
    for _ in range(4):
        X_WT = SE3.from_xyz_rpy(_MIDDLE + rng.uniform(-0.25, 0.25, 3), rng.uniform(-math.pi, math.pi, 3))
        load_tag_plate(client, folder, int(rng.integers(0, 587)), float(rng.uniform(0.05, 0.15)), X_WT)


def random_view(rng: np.random.Generator) -> SE3:
    """Return ``X_WC`` of a camera 0.1 to 1 m from the clutter's middle that looks towards it, with any roll.

    The nearest cameras stand among the boxes, some of which cross their near plane.
    """
    azimuth, height = rng.uniform(-math.pi, math.pi), rng.uniform(0.1, 1.2)
    away = np.array(
        [math.cos(azimuth) * math.cos(height), math.sin(azimuth) * math.cos(height), math.sin(height)]
    )
    p_WC = _MIDDLE + rng.uniform(0.1, 1.0) * away
    forward = _MIDDLE + rng.uniform(-0.1, 0.1, 3) - p_WC
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    roll = rng.uniform(-math.pi, math.pi)
    c, s = math.cos(roll), math.sin(roll)
    return SE3(np.stack([c * right + s * down, -s * right + c * down, forward], axis=1), p_WC)
