"""The calibrations of the cameras of a scene, by the names of cameras in messages."""

from __future__ import annotations

from msrr_scenes.geometry.lens import Lens
from msrr_scenes.messages import OVERHEAD, onboard_camera
from msrr_scenes.specs.scene import Scene


def camera_lenses(scene: Scene) -> dict[str, Lens]:
    """Return the calibration, as everybody is told it, of every camera that there is."""
    driving = (unit for unit in scene.units if scene.geometry(unit).drives)
    lenses = {onboard_camera(unit): scene.cameras.onboard.lens for unit in driving}
    if scene.cameras.overhead is not None:
        lenses[OVERHEAD] = scene.cameras.overhead.lens
    return lenses
