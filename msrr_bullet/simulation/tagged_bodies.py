"""The tags on the units and obstacles of a scene, as visual shapes in a folder that belongs to the trial."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from msrr_bullet.simulation.tag_plates import apply_textures, build_unit_urdf, load_tag_plate
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy
from msrr_scenes.specs.faults import MarkerHidden
from msrr_scenes.specs.scene import Scene

#: How far an obstacle's plate floats above its lid [m], so that the two do not fight for the same depth:
#: TinyRenderer draws a cylinder 1 mm too tall.
PLATE_LIFT_M = 0.002

#: A tag that lies face up: T's z points down into the obstacle, its top edge towards the obstacle's +y.
R_BT = rotation_from_rpy(math.pi, 0.0, 0.0)


def obstacle_tag_pose(height_m: float) -> SE3:
    """Return ``X_BT`` of the tag on an obstacle's lid; B stands on the floor under its middle."""
    return SE3(R_BT, np.array([0.0, 0.0, height_m + PLATE_LIFT_M]))


class TagVisuals:
    """Adds tags to the visual shapes of units and obstacles.

    The folder holds the meshes and textures; it has to exist for as long as the world.
    """

    def __init__(self, scene: Scene, folder: Path) -> None:
        """Use the tags of ``scene``; units with the fault ``marker_hidden`` get blank plates."""
        self._scene = scene
        self._folder = folder
        self._hidden = {f.unit for f in scene.faults if isinstance(f, MarkerHidden)}

    def unit_urdf(self, unit: str) -> Path:
        """Return a copy of the unit's URDF that carries quads for its tags."""
        return build_unit_urdf(self._scene, unit, self._folder, self._hidden)

    def add_to_unit(self, client: int, body: int, unit: str) -> None:
        """Put the textures on the quads of a body loaded from :meth:`unit_urdf`."""
        apply_textures(client, body, self._scene, unit, self._folder)

    def add_to_obstacle(self, client: int, obstacle: str, X_WO: SE2) -> None:
        """Lay the tag of an obstacle that stands at ``X_WO`` on its lid."""
        spec = self._scene.obstacles[obstacle]
        if spec.tag_id is not None:
            X_WT = SE3.from_se2(X_WO) @ obstacle_tag_pose(spec.height_m)
            load_tag_plate(client, self._folder, spec.tag_id, spec.tag_m, X_WT)
