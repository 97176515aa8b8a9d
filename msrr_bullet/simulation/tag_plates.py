"""AprilTag plates: one-sided textured quads as PyBullet bodies.

A plate is the whole print of a tag. Of the default family it is 1.25 times as large as the tag: the black
square and a white border one module wide. PyBullet caches meshes and textures by file name, and bodies that
share a mesh share a texture; so every plate has its own files, in a folder that belongs to one trial.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import cv2

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.tag_print import plate_texture
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.tag_families import TAG36H11, TagFamily


def write_plate(
    folder: Path, name: str, size: float, tag_id: int | None, family: TagFamily = TAG36H11
) -> tuple[Path, Path]:
    """Write a plate's mesh ``<name>.obj`` and texture ``<name>.png`` into ``folder``.

    Args:
        folder: Existing folder that belongs to one trial.
        name: Name of the plate, unique within the folder.
        size: Size of the tag [m]; the edge of the quad is the ``plate_ratio`` of the family times that.
        tag_id: The tag to show; None for a blank plate.
        family: Family of the tag.

    Returns:
        The paths of mesh and texture. The quad lies in the plane z = 0 of the tag frame T (x right, y down, z
        into the tag) and is visible from z < 0 only.
    """
    h = 0.5 * family.plate_ratio * size
    mesh, texture = folder / f"{name}.obj", folder / f"{name}.png"
    mesh.write_text(
        f"v {-h:.9f} {h:.9f} 0\nv {h:.9f} {h:.9f} 0\nv {h:.9f} {-h:.9f} 0\nv {-h:.9f} {-h:.9f} 0\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 -1\n"
        "f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n"
    )
    texture.write_bytes(_texture_file(tag_id, family))
    return mesh, texture


@lru_cache(maxsize=1024)
def _texture_file(tag_id: int | None, family: TagFamily) -> bytes:
    """Return the texture of a plate as a PNG file; every trial writes those of its tags."""
    # The image is encoded in memory, because imwrite does not report why it fails.
    encoded, data = cv2.imencode(".png", plate_texture(tag_id, family))
    assert encoded
    return data.tobytes()


def load_tag_plate(
    client: int, folder: Path, tag_id: int, size: float, X_WT: SE3, family: TagFamily = TAG36H11
) -> int:
    """Load a free-standing, massless plate without collision shape and return the body id.

    Args:
        client: PyBullet client.
        folder: Existing folder that belongs to one trial.
        tag_id: The tag to show.
        size: Size of the tag [m].
        X_WT: Pose of the tag frame (z into the tag).
        family: Family of the tag.
    """
    name = f"tag_{tag_id}_{round(1e6 * size)}um"
    mesh, texture = write_plate(folder, name, size, tag_id, family)
    shape = pybullet.createVisualShape(
        pybullet.GEOM_MESH, fileName=str(mesh.resolve()), rgbaColor=[1, 1, 1, 1], physicsClientId=client
    )
    body: int = pybullet.createMultiBody(
        baseMass=0.0,
        baseVisualShapeIndex=shape,
        basePosition=X_WT.p.tolist(),
        baseOrientation=X_WT.quaternion_xyzw().tolist(),
        physicsClientId=client,
    )
    set_texture(client, body, -1, 0, texture)
    return body


def set_texture(client: int, body: int, link: int, shape: int, texture: Path) -> None:
    """Set the texture of one visual shape, given by the index of a link and of a shape of that link."""
    handle = pybullet.loadTexture(str(texture.resolve()), physicsClientId=client)
    # No rgbaColor here: PyBullet repaints every shape of the link with it, whatever the index of the shape.
    pybullet.changeVisualShape(
        body,
        link,
        shapeIndex=shape,
        textureUniqueId=handle,
        physicsClientId=client,
    )
