"""The frames that a viewer needs to put a log's messages in their places."""

from __future__ import annotations

import math

import numpy as np

from msrr_bullet.log.formats import target_frame
from msrr_bullet.log.foxglove import WORLD
from msrr_bullet.log.records import FrameLink, FrameLinks, StepStart
from msrr_scenes.geometry.pinhole import optical_pose
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy
from msrr_scenes.specs.scene import Scene


def scene_frames(scene: Scene) -> FrameLinks:
    """Return what is fixed to the units and to the world, as the scene nominally has it.

    The dock frame D of a port is called ``<unit>.<port>``, as in a plan; a camera's optical frame has the
    camera's name.
    """
    links: list[FrameLink] = []
    for unit in scene.units:
        geometry = scene.geometry(unit)
        for port in geometry.ports:
            links.append(FrameLink(unit, f"{unit}.{port}", SE3.from_se2(geometry.dock_frame(port))))
        links.append(FrameLink(unit, f"{unit}/onboard", optical_pose(geometry.frame("camera"))))
    overhead = scene.cameras.overhead
    if overhead is not None:
        # Image right is world x, image down is world -y: half a turn about x.
        down = rotation_from_rpy(math.pi, 0.0, 0.0)
        position = np.array([overhead.x_m, overhead.y_m, overhead.height_m])
        links.append(FrameLink(WORLD, "overhead", SE3(down, position)))
    return FrameLinks(0, tuple(links))


def step_frames(scene: Scene, start: StepStart) -> FrameLinks:
    """Return the dock frame that a step's estimates are given in: ``<unit>/target``."""
    step = scene.plan[start.index]
    return FrameLinks(start.stamp_ns, (FrameLink(step.to, target_frame(start.unit), SE3()),))
