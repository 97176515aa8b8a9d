"""AprilTag plates: one-sided textured quads as PyBullet bodies.

A plate is the whole print of a tag. Of the default family it is 1.25 times as large as the tag: the black
square and a white border one module wide. PyBullet caches meshes and textures by file name, and bodies that
share a mesh share a texture; so every tag has its own files, which plates of all sizes and all trials of a
process share.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
import threading
from functools import lru_cache
from pathlib import Path

import cv2

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.tag_print import plate_texture
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.tag_families import TAG36H11, TagFamily
from msrr_scenes.temporary_files import room_for_temporary_files

_LOCK = threading.Lock()

#: A square from -1 to 1.
_SQUARE = (
    b"v -1 1 0\nv 1 1 0\nv 1 -1 0\nv -1 -1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 -1\n"
    b"f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n"
)


def plate_folder() -> Path:
    """Return the folder for plates of this process, which is deleted when the process ends."""
    with _LOCK:  # trials in threads that begin together need the same folder
        return _plate_folder()


@lru_cache(maxsize=1)
def _plate_folder() -> Path:
    folder = tempfile.mkdtemp(prefix="msrr-plates-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder).resolve()


@room_for_temporary_files()
def write_plate(folder: Path, tag_id: int | None, family: TagFamily = TAG36H11) -> tuple[Path, Path]:
    """Write the mesh and the texture of a plate into ``folder``, unless they are there.

    The folder is made if it is not there. The plate is blank without a tag.

    Returns:
        The paths of mesh and texture. The quad lies in the plane z = 0 of the tag frame T (x right, y down, z
        into the tag) and is visible from z < 0 only. Its edges are 2 m long before :func:`plate_scale`.
    """
    name = f"{family.name}_{'blank' if tag_id is None else tag_id}"
    mesh, texture = folder / f"{name}.obj", folder / f"{name}.png"
    if not (mesh.is_file() and texture.is_file()):
        folder.mkdir(parents=True, exist_ok=True)  # systems clear temporary files that are days old
        # The image is encoded in memory, because imwrite does not report why it fails.
        encoded, data = cv2.imencode(".png", plate_texture(tag_id, family))
        assert encoded
        _put(texture, data.tobytes())
        _put(mesh, _SQUARE)
    return mesh, texture


def _put(path: Path, content: bytes) -> None:
    """Write a file that other threads see whole or not at all."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as part:
        part.write(content)
    os.replace(part.name, path)


def plate_scale(size: float, family: TagFamily = TAG36H11) -> tuple[float, float, float]:
    """Return the scale of the mesh of :func:`write_plate` for a tag of this size [m], in whole nanometres.

    The edge of the plate is the ``plate_ratio`` of the family times the size of the tag.
    """
    half = round(0.5 * family.plate_ratio * size, 9)
    return half, half, 1.0


def load_tag_plate(
    client: int,
    folder: Path,
    tag_id: int,
    size: float,
    X_WT: SE3,
    family: TagFamily = TAG36H11,
    *,
    textured: bool = True,
) -> int:
    """Load a free-standing, massless plate without collision shape and return the body id.

    ``folder`` is for the files of the plate, the tag has the edge ``size`` [m], z of its frame points into
    it, and ``textured`` is whether PyBullet is given the texture.
    """
    mesh, texture = write_plate(folder, tag_id, family)
    shape = pybullet.createVisualShape(
        pybullet.GEOM_MESH,
        fileName=str(mesh.resolve()),
        meshScale=plate_scale(size, family),
        rgbaColor=[1, 1, 1, 1],
        physicsClientId=client,
    )
    body: int = pybullet.createMultiBody(
        baseMass=0.0,
        baseVisualShapeIndex=shape,
        basePosition=X_WT.p.tolist(),
        baseOrientation=X_WT.quaternion_xyzw().tolist(),
        physicsClientId=client,
    )
    if textured:
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
