"""The naive loop: a trial without the three things that make perception cheap here.

It reads full frames only, detects tags in all of them, and the renderer draws the floor as a mesh.
"""

from __future__ import annotations

from msrr_scenes.geometry.distortion import COEFFICIENTS
from msrr_scenes.specs.deviations import CoefficientDeviation
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec
from msrr_scenes.specs.spec import Choice


def naive_loop(scene: Scene, samples: int | None = None) -> Scene:
    """Return the scene of the naive loop, with full frames and a floor mesh.

    Args:
        scene: Scene of the trial.
        samples: Samples per pixel edge of the cameras; None keeps the scene's.
    """

    def plain(camera: CameraSpec) -> dict[str, object]:
        return {
            "renderer": Choice(name="tiny", params={"floor": "mesh"}),
            "readout": "frames",
            "samples": samples or camera.samples,
            "exposure_ms": 0.0,  # TinyRenderer draws one instant only
            "rolling_shutter_ms": 0.0,
        }

    cameras = scene.cameras
    overhead = cameras.overhead
    slow = cameras.model_copy(
        update={
            "onboard": cameras.onboard.model_copy(update=plain(cameras.onboard)),
            "overhead": overhead.model_copy(update=plain(overhead)) if overhead else None,
        }
    )
    lens = {key: CoefficientDeviation() for key in COEFFICIENTS}  # TinyRenderer draws ideal lenses only
    deviations = scene.as_built
    ideal = {group: getattr(deviations, group).model_copy(update=lens) for group in ("onboard", "overhead")}
    return scene.model_copy(update={"cameras": slow, "as_built": deviations.model_copy(update=ideal)})
