"""The calibrations of the cameras of a scene, by the names of cameras in messages, and where they end."""

from __future__ import annotations

import numpy as np

from msrr_scenes.geometry.distortion import fold_radius
from msrr_scenes.geometry.lens import Lens, frame_outline
from msrr_scenes.messages import OVERHEAD, onboard_camera
from msrr_scenes.specs.scene import Scene


def camera_lenses(scene: Scene) -> dict[str, Lens]:
    """Return the calibration, as everybody is told it, of every camera that there is."""
    driving = (unit for unit in scene.units if scene.geometry(unit).drives)
    lenses = {onboard_camera(unit): scene.cameras.onboard.lens for unit in driving}
    if scene.cameras.overhead is not None:
        lenses[OVERHEAD] = scene.cameras.overhead.lens
    return lenses


def explained_fold(lens: Lens) -> str | None:
    """Return in words where a lens shows two points of the scene at one pixel of the frame, if it does."""
    radius, camera = fold_radius(lens.camera, lens.distortion), lens.camera
    if radius is None:
        return None
    corner = np.hypot(*(frame_outline(camera.frame) - [camera.cx, camera.cy]).T).max()
    return (
        f"with {lens.distortion} two points of the scene appear at one pixel: it has an inverse up to "
        f"about {radius:.0f} px from the principal point, and the frame reaches to {corner:.0f} px"
    )
