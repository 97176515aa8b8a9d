"""The floor as a textured mesh in the world: what a simulator's cameras usually look at, and what it costs.

The cameras of a trial composite the floor instead (:mod:`msrr_bullet.render.floor`); the mesh is there to
measure the difference and to check the one against the other.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
import pybullet

from msrr_bullet.render.floor import Floor
from msrr_scenes.errors import MsrrError

#: Half the edge of the mesh [m]. TinyRenderer walks over the pixels of a triangle, not over its metres.
_REACH = 40.0

_MARK = "msrr_floor_mesh"


def ensure_floor_mesh(client: int, floor: Floor) -> int:
    """Put the floor's mesh into the client unless it is there already; return its body id.

    It has no collision shape and takes no part in the physics.
    """
    for index in range(pybullet.getNumBodies(physicsClientId=client)):
        body: int = pybullet.getBodyUniqueId(index, physicsClientId=client)
        if pybullet.getUserDataId(body, _MARK, physicsClientId=client) >= 0:
            return body
    turns = _REACH / floor.period
    square = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    shape = pybullet.createVisualShape(
        pybullet.GEOM_MESH,
        vertices=[[_REACH * x, _REACH * y, 0.0] for x, y in square],
        indices=[0, 1, 2, 0, 2, 3],
        # Kept positive: TinyRenderer truncates where it should take the floor.
        uvs=[[turns * (x + 1.0), turns * (y + 1.0)] for x, y in square],
        normals=[[0.0, 0.0, 1.0]] * 4,
        rgbaColor=[1, 1, 1, 1],
        physicsClientId=client,
    )
    body = pybullet.createMultiBody(baseMass=0.0, baseVisualShapeIndex=shape, physicsClientId=client)
    pybullet.changeVisualShape(body, -1, textureUniqueId=_load_texture(client, floor), physicsClientId=client)
    pybullet.addUserData(body, _MARK, "1", physicsClientId=client)
    return body


def _load_texture(client: int, floor: Floor) -> int:
    # A texture's last row is at v = 0, where y is least.
    texture = np.clip(np.rint(floor.levels[0][::-1]), 0, 255).astype(np.uint8)
    encoded, data = cv2.imencode(".png", cv2.cvtColor(texture, cv2.COLOR_GRAY2BGR))
    if not encoded:
        raise MsrrError("OpenCV cannot write the floor's texture as PNG")
    with tempfile.TemporaryDirectory(prefix="msrr_floor_") as folder:
        path = Path(folder) / "floor.png"
        path.write_bytes(data.tobytes())
        handle: int = pybullet.loadTexture(str(path), physicsClientId=client)
    return handle
