"""What PyBullet knows of its bodies' looks and poses, as arrays for the kernels.

Shapes are read once. Links that cannot move against each other share a *mover*, a frame whose pose is read at
each exposure: a body's base, and each link behind a joint that is not fixed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pybullet

from msrr_bullet.render.raster.look import VisualShape
from msrr_bullet.render.raster.mesh import Mesh, box, capsule, cylinder, sphere
from msrr_bullet.render.raster.mesh_file import MeshPart, read_mesh
from msrr_bullet.render.raster.texture import Texture, read_texture
from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3

#: Weights of red, green and blue in a grey level (ITU-R BT.601), as OpenCV has them.
_LUMA = np.array([0.299, 0.587, 0.114])

#: An entry of PyBullet's getVisualShapeData.
Shape = tuple[Any, ...]

#: Link index by which PyBullet names a body's base.
_BASE = -1


class Bodies:
    """The bodies of a PyBullet client as they are loaded now.

    Attributes:
        looks: All visible shapes.
        loaded: Ids of the bodies it was built from.
    """

    def __init__(self, client: int) -> None:
        """Read all bodies.

        Raises:
            GeometryError: A body has a visual shape that cannot be drawn.
        """
        self._client = client
        self.loaded = loaded_bodies(client)
        self._bases: list[int] = []
        self._links: list[tuple[int, list[int]]] = []
        self.looks: list[VisualShape] = []
        pending: dict[tuple[int, int], list[VisualShape]] = {}
        for body in self.loaded:
            for (root, X_MG), shape in _shapes(client, body):
                pending.setdefault((body, root), []).extend(_looks(shape, X_MG))
        bases = [key for key in pending if key[1] == _BASE]
        links = sorted(key for key in pending if key[1] != _BASE)
        for number, key in enumerate(bases + links):
            self.looks += [replace(look, mover=number) for look in pending[key]]
        self._bases = [body for body, _ in bases]
        for body, link in links:
            if not self._links or self._links[-1][0] != body:
                self._links.append((body, []))
            self._links[-1][1].append(link)
        self.movers = len(pending)

    def poses(self) -> Array:
        """Return position and quaternion xyzw of every mover in W as it stands, shape (M, 7)."""
        client = self._client
        rows = []
        for body in self._bases:
            position, quaternion = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
            rows.append(position + quaternion)
        for body, links in self._links:
            states = pybullet.getLinkStates(body, links, computeForwardKinematics=1, physicsClientId=client)
            rows += [state[4] + state[5] for state in states]
        return np.array(rows, dtype=np.float64).reshape(-1, 7)


def loaded_bodies(client: int) -> tuple[int, ...]:
    """Return the ids of the bodies in a client."""
    count = pybullet.getNumBodies(physicsClientId=client)
    return tuple(pybullet.getBodyUniqueId(i, physicsClientId=client) for i in range(count))


def _shapes(client: int, body: int) -> Iterator[tuple[tuple[int, SE3], Shape]]:
    """Yield each visual shape of a body with the link that its mover is named after and its pose there."""
    shapes = pybullet.getVisualShapeData(
        body, flags=pybullet.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS, physicsClientId=client
    )
    roots: dict[int, tuple[int, SE3]] = {}
    for shape in shapes:
        link = shape[1]
        if link not in roots:
            roots[link] = _mover_of(client, body, link)
        root, X_ML = roots[link]
        yield (root, X_ML @ SE3.from_quaternion_xyzw(shape[5], shape[6])), shape


def _mover_of(client: int, body: int, link: int) -> tuple[int, SE3]:
    """Return the link that a link is rigidly joined to, nearest to the base, and the link's pose there."""
    root = link
    while root != _BASE:
        joint = pybullet.getJointInfo(body, root, physicsClientId=client)
        if joint[2] != pybullet.JOINT_FIXED:
            break
        root = joint[16]
    return root, _link_pose(client, body, root).inverse() @ _link_pose(client, body, link, of_mover=False)


def _link_pose(client: int, body: int, link: int, of_mover: bool = True) -> SE3:
    """Return a link's frame in W; for the base, as a mover, the inertial frame: PyBullet's base pose."""
    if link == _BASE:
        base = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        X_WI = SE3.from_quaternion_xyzw(*base)
        if of_mover:
            return X_WI
        info = pybullet.getDynamicsInfo(body, _BASE, physicsClientId=client)
        return X_WI @ SE3.from_quaternion_xyzw(info[3], info[4]).inverse()
    state = pybullet.getLinkState(body, link, computeForwardKinematics=1, physicsClientId=client)
    return SE3.from_quaternion_xyzw(state[4], state[5])


def _looks(shape: Shape, X_MG: SE3) -> Iterator[VisualShape]:
    """Yield what is to be drawn of one entry of getVisualShapeData (numbered by mover later)."""
    body, link, kind, size, filename, _, _, rgba, texture_id = shape
    if rgba[3] == 0.0 or kind == pybullet.GEOM_PLANE:
        return  # invisible; or an endless plane, which TinyRenderer does not draw either: the floor is given
    grey = float(_LUMA @ rgba[:3])
    if kind == pybullet.GEOM_MESH:
        where = f"body {body}, link {link}"
        if not filename:
            raise GeometryError(
                f"{where}: the raster renderer draws meshes from files; this one was given by its vertices"
            )
        for part in read_mesh(Path(filename.decode())):
            mesh = part.mesh.scaled(np.array(size))
            yield VisualShape(0, X_MG, mesh, grey, _texture(part, textured=texture_id >= 0, where=where))
        return
    primitive = _primitive(kind, size)
    if primitive is None:
        raise GeometryError(
            f"body {body}, link {link}: the raster renderer draws boxes, spheres, cylinders, capsules and "
            f"mesh files, not PyBullet's shape type {kind}"
        )
    yield VisualShape(0, X_MG, primitive, grey, None)


def _texture(part: MeshPart, textured: bool, where: str) -> Texture | None:
    """Return the picture on a part of a mesh.

    PyBullet says that a mesh is ``textured`` by its own materials, and is silent about textures put on later.
    """
    if part.mesh.uv is None or (part.from_material and not textured):
        return None
    if part.texture is None and not textured:
        return None
    if part.texture is None:
        raise GeometryError(
            f"{where}: PyBullet does not tell which file a texture came from; put the picture beside the "
            "mesh under the mesh's name, or name it in the mesh's material file"
        )
    return read_texture(part.texture)


@lru_cache(maxsize=512)
def _primitive(kind: int, size: tuple[float, float, float]) -> Mesh | None:
    """Return the mesh of a primitive shape, None for a kind that is none; units and trials are alike."""
    if kind == pybullet.GEOM_BOX:
        return box(np.array(size))
    if kind == pybullet.GEOM_SPHERE:
        return sphere(size[0])
    if kind == pybullet.GEOM_CYLINDER:
        return cylinder(size[1], size[0])
    if kind == pybullet.GEOM_CAPSULE:
        return capsule(size[1], size[0])
    return None
