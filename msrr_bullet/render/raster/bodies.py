"""Visual shapes and poses of the bodies that are loaded in a PyBullet client.

Shapes are read once. Links that cannot move against each other share a moving frame M, whose pose is read for
each picture: the base of a body, or a link behind a joint that is not fixed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from msrr_bullet.render.raster.assembly import VisualShape
from msrr_bullet.render.raster.mesh import Mesh, box, capsule, cylinder, sphere
from msrr_bullet.render.raster.mesh_file import MeshPart, read_mesh
from msrr_bullet.render.raster.texture import Texture, read_texture
from msrr_bullet.silent_pybullet import pybullet
from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3

#: Weights of red, green and blue in a grey level (ITU-R BT.601), the same as in OpenCV.
_LUMA = np.array([0.299, 0.587, 0.114])

#: An entry of PyBullet's getVisualShapeData.
ShapeData = tuple[Any, ...]

#: PyBullet's link index of the base of a body.
_BASE = -1

#: Numbers by which the bodies of one :class:`LoadedBodies` are marked in PyBullet's user data: a new body may
#: have the id of one that was removed.
_NUMBERS = count()


class LoadedBodies:
    """The bodies that were loaded in a PyBullet client at one instant, with all visible shapes."""

    def __init__(self, client: int) -> None:
        """Read all bodies.

        Raises:
            GeometryError: A body has a visual shape that cannot be drawn.
        """
        self._client = client
        self._mark = f"msrr_read_{next(_NUMBERS)}"
        self.ids = body_ids(client)
        shapes: dict[tuple[int, int], list[VisualShape]] = {}
        for body in self.ids:
            for (root, X_MG), entry in _entries(client, body):
                shapes.setdefault((body, root), []).extend(_visual_shapes(entry, X_MG))
        bases = [key for key in shapes if key[1] == _BASE]
        links = sorted(key for key in shapes if key[1] != _BASE)
        self.shapes = [
            replace(shape, frame=number) for number, key in enumerate(bases + links) for shape in shapes[key]
        ]
        self.frame_count = len(shapes)
        self._bases = [body for body, _ in bases]
        self._links: dict[int, list[int]] = {}
        for body, link in links:
            self._links.setdefault(body, []).append(link)
        self._rows: dict[int, list[int]] = {}
        for row, (body, _) in enumerate(bases + links):
            self._rows.setdefault(body, []).append(row)
        for body in self.ids:
            pybullet.addUserData(body, self._mark, "", physicsClientId=client)

    def are_loaded(self) -> bool:
        """Say whether the client has these bodies and no others now."""
        client = self._client
        return body_ids(client) == self.ids and all(
            pybullet.getUserDataId(body, self._mark, physicsClientId=client) >= 0 for body in self.ids
        )

    def poses(self) -> Array:
        """Return position [m] and quaternion xyzw of each moving frame in W at this instant, shape (M, 7)."""
        client = self._client
        rows = []
        for body in self._bases:
            position, quaternion = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
            rows.append(position + quaternion)
        for body, links in self._links.items():
            states = pybullet.getLinkStates(body, links, computeForwardKinematics=1, physicsClientId=client)
            rows += [state[4] + state[5] for state in states]
        return np.array(rows, dtype=np.float64).reshape(-1, 7)

    def triangles(self, body: int) -> Array:
        """Return the corners in W of all triangles that are drawn of a body now, shape (T, 3, 3) [m].

        They are counter-clockwise when seen from outside.
        """
        poses, rows = self.poses(), self._rows.get(body, [])
        corners = [
            (SE3.from_quaternion_xyzw(poses[shape.frame, :3], poses[shape.frame, 3:]) @ shape.X_MG).act(
                shape.mesh.vertices
            )[shape.mesh.triangles]
            for shape in self.shapes
            if shape.frame in rows
        ]
        return np.concatenate([np.empty((0, 3, 3)), *corners])

    def displaced(self, poses: Array, displacements: Mapping[int, SE3]) -> Array:
        """Return :meth:`poses` after bodies, given by their ids, have been displaced as a whole.

        Poses are position [m] and quaternion xyzw of each moving frame in W, shape (M, 7), and displacements
        motions of points in W; those of bodies of no moving frame are left out.
        """
        if not displacements:
            return poses
        out = poses.copy()
        for body, D in displacements.items():
            rows = self._rows.get(body, [])
            out[rows, :3] = D.act(poses[rows, :3])
            x, y, z, w = D.quaternion_xyzw()
            product = np.array([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]])
            out[rows, 3:] = poses[rows, 3:] @ product.T
        return out


def body_ids(client: int) -> tuple[int, ...]:
    """Return the unique ids of the bodies that are loaded in a client."""
    count = pybullet.getNumBodies(physicsClientId=client)
    return tuple(pybullet.getBodyUniqueId(i, physicsClientId=client) for i in range(count))


def _entries(client: int, body: int) -> Iterator[tuple[tuple[int, SE3], ShapeData]]:
    """Yield each visual shape of a body with the link of its moving frame M and the shape's pose in M."""
    entries = pybullet.getVisualShapeData(
        body, flags=pybullet.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS, physicsClientId=client
    )
    roots: dict[int, tuple[int, SE3]] = {}
    for entry in entries:
        link = entry[1]
        if link not in roots:
            roots[link] = _rigid_root(client, body, link)
        root, X_ML = roots[link]
        yield (root, X_ML @ SE3.from_quaternion_xyzw(entry[5], entry[6])), entry


def _rigid_root(client: int, body: int, link: int) -> tuple[int, SE3]:
    """Return the link nearest to the base that is rigidly joined to ``link``, and the pose of ``link``."""
    root = link
    while root != _BASE:
        joint = pybullet.getJointInfo(body, root, physicsClientId=client)
        if joint[2] != pybullet.JOINT_FIXED:
            break
        root = joint[16]
    X_WL = _link_pose(client, body, link)
    if root != _BASE:
        return root, _link_pose(client, body, root).inverse() @ X_WL
    return root, _base_pose(client, body).inverse() @ X_WL


def _base_pose(client: int, body: int) -> SE3:
    """Return what PyBullet calls the pose of the base: its inertial frame in W."""
    return SE3.from_quaternion_xyzw(*pybullet.getBasePositionAndOrientation(body, physicsClientId=client))


def _link_pose(client: int, body: int, link: int) -> SE3:
    """Return the frame of a link, as the URDF has it, in W."""
    if link == _BASE:
        info = pybullet.getDynamicsInfo(body, _BASE, physicsClientId=client)
        return _base_pose(client, body) @ SE3.from_quaternion_xyzw(info[3], info[4]).inverse()
    state = pybullet.getLinkState(body, link, computeForwardKinematics=1, physicsClientId=client)
    return SE3.from_quaternion_xyzw(state[4], state[5])


def _visual_shapes(entry: ShapeData, X_MG: SE3) -> Iterator[VisualShape]:
    """Yield what is drawn of one entry of getVisualShapeData, on moving frame 0 for the time being."""
    body, link, kind, size, filename, _, _, rgba, texture_id = entry
    if rgba[3] == 0.0 or kind == pybullet.GEOM_PLANE:
        return  # invisible; or an endless plane, for which the floor is drawn
    grey = float(_LUMA @ rgba[:3])
    where = f"body {body}, link {link}"
    if kind == pybullet.GEOM_MESH:
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
            f"{where}: the raster renderer draws boxes, spheres, cylinders, capsules and mesh files, not "
            f"PyBullet's shape type {kind}"
        )
    yield VisualShape(0, X_MG, primitive, grey)


def _texture(part: MeshPart, textured: bool, where: str) -> Texture | None:
    """Return the texture of a part of a mesh, or None.

    ``textured`` is whether PyBullet reports a texture of the mesh's own materials; it reports none that were
    put on later. ``where`` names body and link for error messages.
    """
    if part.mesh.uv is None or (part.from_material and not textured):
        return None
    if part.texture is None and not textured:
        return None
    if part.texture is None:
        raise GeometryError(
            f"{where}: PyBullet does not tell which file a texture came from; put the image beside the "
            "mesh under the mesh's name, or name it in the mesh's material file"
        )
    return read_texture(part.texture)


@lru_cache(maxsize=512)
def _primitive(kind: int, size: tuple[float, float, float]) -> Mesh | None:
    """Return the mesh of a primitive shape, or None if ``kind`` is none; units and trials share meshes."""
    if kind == pybullet.GEOM_BOX:
        return box(np.array(size))
    if kind == pybullet.GEOM_SPHERE:
        return sphere(size[0])
    if kind == pybullet.GEOM_CYLINDER:
        return cylinder(size[1], size[0])
    if kind == pybullet.GEOM_CAPSULE:
        return capsule(size[1], size[0])
    return None
