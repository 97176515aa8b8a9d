"""AprilTag plates: bitmaps, one-sided textured quads, and the copy of a unit's URDF that carries them.

A plate is a white square of 1.25 times the tag's size: the tag's black square and a white border one module
wide. PyBullet caches meshes and textures by file name, and bodies that share a mesh share its texture; so
every plate gets files of its own, in a folder that belongs to one trial.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray

from msrr_bullet.simulation.urdf_welding import read_urdf, weld
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.scene import Scene

Pixels = NDArray[np.uint8]

#: Modules (bits) along the edge of the black square, and along the plate with its white border.
TAG_MODULES = 8
PLATE_MODULES = TAG_MODULES + 2

#: Edge of a plate over the edge of its tag's black square.
PLATE_RATIO = PLATE_MODULES / TAG_MODULES

#: Grey levels of the print; paper does not saturate the sensor and ink is not a black hole.
WHITE, BLACK = 240, 15

#: Texels per module. TinyRenderer takes the nearest texel, for which one would do; viewers interpolate.
_TEXELS = 16


def tag_bitmap(tag_id: int) -> NDArray[np.bool_]:
    """Return the modules of a tag36h11 plate, shape (10, 10), white true, as AprilRobotics print it.

    OpenCV's dictionary holds the same tags turned by half a turn; they are turned back here, so that the
    corner order of the AprilTag detector begins at the bottom left of this bitmap.

    Raises:
        GeometryError: The family has no such tag.
    """
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    if not 0 <= tag_id < len(family.bytesList):
        raise GeometryError(
            f"tag id {tag_id} is not in tag36h11, which has ids 0 .. {len(family.bytesList) - 1}"
        )
    black_square = cv2.aruco.generateImageMarker(family, tag_id, TAG_MODULES, borderBits=1)
    return np.pad(np.rot90(black_square, 2) > 127, 1, constant_values=True)


def plate_texture(tag_id: int | None) -> Pixels:
    """Return the picture of a plate, shape (160, 160, 3); ``None`` is a blank plate."""
    white = np.ones((PLATE_MODULES, PLATE_MODULES), dtype=np.bool_) if tag_id is None else tag_bitmap(tag_id)
    grey = np.where(white, WHITE, BLACK).astype(np.uint8)
    return np.repeat(np.kron(grey, np.ones((_TEXELS, _TEXELS), dtype=np.uint8))[..., None], 3, axis=2)


def write_plate(folder: Path, name: str, size: float, tag_id: int | None) -> tuple[Path, Path]:
    """Write a plate's mesh ``<name>.obj`` and texture ``<name>.png`` into ``folder``.

    Args:
        folder: Existing folder that belongs to one trial.
        name: Unique within the folder.
        size: Edge of the tag's black square [m]; the quad is :data:`PLATE_RATIO` times that.
        tag_id: The tag to show; None for a blank plate.

    Returns:
        The two paths. The quad lies in the plane z = 0 of the tag frame T (x right, y down, z into the tag)
        and is visible from z < 0 only.
    """
    h = 0.5 * PLATE_RATIO * size
    mesh, texture = folder / f"{name}.obj", folder / f"{name}.png"
    mesh.write_text(
        f"v {-h:.9f} {h:.9f} 0\nv {h:.9f} {h:.9f} 0\nv {h:.9f} {-h:.9f} 0\nv {-h:.9f} {-h:.9f} 0\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 -1\n"
        "f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n"
    )
    # Encoded in memory: imwrite says False instead of why, and knows no Path.
    encoded, data = cv2.imencode(".png", plate_texture(tag_id))
    assert encoded
    texture.write_bytes(data.tobytes())
    return mesh, texture


def _plate_name(unit: str, slot: str) -> str:
    return f"{unit}_{slot}"


def build_unit_urdf(scene: Scene, unit: str, folder: Path, hidden: Collection[str] = ()) -> Path:
    """Write a copy of a unit's URDF that shows its plates, welded for the engine; return its path.

    Args:
        scene: Says which URDF, which ids and which sizes.
        unit: Name of the unit.
        folder: Existing folder that belongs to one trial; receives the URDF, meshes and textures.
        hidden: Units whose plates are blank (fault ``marker_hidden``).

    Raises:
        GeometryError: A tag slot has no link in the URDF.
    """
    geometry = scene.geometry(unit)
    tree = read_urdf(geometry.urdf)
    links = {e.attrib["name"]: e for e in tree.getroot().findall("link")}
    for slot, tag_id in scene.tag_ids(unit).items():
        if slot not in links:
            raise GeometryError(
                f"{geometry.urdf}: no link for tag {tag_id} at {slot!r}; tag links: {geometry.tag_slots}"
            )
        shown = None if unit in hidden else tag_id
        mesh, _ = write_plate(folder, _plate_name(unit, slot), scene.tag_size(slot), shown)
        _add_visual(links[slot], mesh)
    weld(tree, geometry.mechanism)
    path = folder / f"{unit}.urdf"
    tree.write(path, encoding="utf-8", xml_declaration=True)
    return path


def _add_visual(link: ElementTree.Element, mesh: Path) -> None:
    visual = ElementTree.SubElement(link, "visual")
    ElementTree.SubElement(visual, "origin", xyz="0 0 0", rpy="0 0 0")
    ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), "mesh", filename=str(mesh.resolve()))
    material = ElementTree.SubElement(visual, "material", name=f"plate_{mesh.stem}")
    ElementTree.SubElement(material, "color", rgba="1 1 1 1")


def apply_textures(client: int, body: int, scene: Scene, unit: str, folder: Path) -> None:
    """Put the plates' textures on a unit loaded from :func:`build_unit_urdf`'s file.

    Args:
        client: PyBullet client.
        body: The loaded unit.
        scene: As given to :func:`build_unit_urdf`.
        unit: Name of the unit.
        folder: As given to :func:`build_unit_urdf`.

    Raises:
        GeometryError: The body lacks a plate (it was loaded from another file).
    """
    plates: dict[str, tuple[int, int]] = {}
    count: dict[int, int] = {}
    for shape in pybullet.getVisualShapeData(body, physicsClientId=client):
        link, mesh = shape[1], shape[4].decode()
        plates[mesh] = (link, count.setdefault(link, 0))
        count[link] += 1
    for slot in scene.tag_ids(unit):
        name = _plate_name(unit, slot)
        plate = plates.get(str((folder / f"{name}.obj").resolve()))
        if plate is None:
            raise GeometryError(f"body {body} of unit {unit!r} has no plate for {slot!r}")
        _set_texture(client, body, *plate, folder / f"{name}.png")


def load_tag_plate(client: int, folder: Path, tag_id: int, size: float, X_WT: SE3) -> int:
    """Load a free-standing, massless plate without collision shape; return its body id.

    Args:
        client: PyBullet client.
        folder: Existing folder that belongs to one trial.
        tag_id: Tag to show.
        size: Edge of the black square [m].
        X_WT: Pose of the tag frame (z into the tag).
    """
    name = f"tag_{tag_id}_{round(1e6 * size)}um"
    mesh, texture = write_plate(folder, name, size, tag_id)
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
    _set_texture(client, body, -1, 0, texture)
    return body


def _set_texture(client: int, body: int, link: int, shape: int, texture: Path) -> None:
    handle = pybullet.loadTexture(str(texture.resolve()), physicsClientId=client)
    pybullet.changeVisualShape(
        body,
        link,
        shapeIndex=shape,
        textureUniqueId=handle,
        rgbaColor=[1, 1, 1, 1],
        physicsClientId=client,
    )
