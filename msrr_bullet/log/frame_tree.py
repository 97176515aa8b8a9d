"""The coordinate frames of a scene that do not move in their parents."""

from __future__ import annotations

import math

import numpy as np

from msrr_bullet.log.records import FrameLink, FrameLinks
from msrr_scenes.geometry.pinhole import optical_pose
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy
from msrr_scenes.messages import OVERHEAD, onboard_camera
from msrr_scenes.specs.scene import Scene

WORLD = "world"


def scene_frames(scene: Scene) -> FrameLinks:
    """Return the frames that are fixed to the units and to the world, from the nominal scene.

    The dock frame D of a port is called ``<unit>.<port>``, as in a plan. The optical frame of a camera has
    the name of the camera.
    """
    links: list[FrameLink] = []
    for unit in scene.units:
        geometry = scene.geometry(unit)
        for port in geometry.ports:
            links.append(FrameLink(unit, f"{unit}.{port}", SE3.from_se2(geometry.dock_frame(port))))
        if geometry.drives:
            links.append(FrameLink(unit, onboard_camera(unit), optical_pose(geometry.frame("camera"))))
    overhead = scene.cameras.overhead
    if overhead is not None:
        # Image right is world x, image down is world -y: half a turn about x.
        down = rotation_from_rpy(math.pi, 0.0, 0.0)
        position = np.array([overhead.x_m, overhead.y_m, overhead.height_m])
        links.append(FrameLink(WORLD, OVERHEAD, SE3(down, position)))
    return FrameLinks(0, tuple(links))
