"""The response of a camera as effects: keys of the data sheet that turn a drawn picture into a real one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from msrr_scenes.specs.scene import Scene


@dataclass(frozen=True, slots=True)
class Response:
    """How an error changes one key of a camera.

    Attributes:
        description: What the key is, with the unit of the error.
        unit: Unit of the error.
        step: Error by which effects are compared.
        change: Whether the error is added to the key, doubles it, or is quality lost.
        signs: Signs of the errors that are tried.
    """

    description: str
    unit: str
    step: float
    change: Literal["add", "double", "lose"] = "add"
    signs: tuple[float, ...] = (1.0,)


#: Responses by key of :class:`msrr_scenes.specs.sensors.CameraSpec`.
RESPONSES: Mapping[str, Response] = {
    "noise_grey": Response("read noise beyond the data sheet", "grey levels", 2.0),
    "shot_grey": Response("shot noise beyond the data sheet", "grey levels", 2.0),
    "blur_px": Response("blur of the lens beyond the data sheet", "px", 0.4),
    "exposure_ms": Response("time of exposure beyond the data sheet", "ms", 10.0),
    "rolling_shutter_ms": Response("time from the top row to the bottom row", "ms", 10.0),
    "gain": Response("gain, which sets brightness and contrast", "doublings", 0.5, "double", (1.0, -1.0)),
    "gamma": Response("gamma of the tone curve", "doublings", 0.25, "double", (1.0, -1.0)),
    "vignetting": Response("share of the light that is lost in the corners", "", 0.1),
    "light_gradient": Response("rise of the light over one width of the image", "", 0.1),
    "jpeg_quality": Response("quality that JPEG compression loses, of 100", "points", 10.0, "lose"),
}


def with_response(scene: Scene, error: float, *, camera: str, key: str) -> Scene:
    """Return the scene with an error in one key of a camera.

    Raises:
        pydantic.ValidationError: The camera cannot have this value.
    """
    spec = getattr(scene.cameras, camera)
    value = getattr(spec, key)
    match RESPONSES[key].change:
        case "add":
            changed = value + error
        case "double":
            changed = value * 2.0**error
        case "lose":
            changed = round((100 if value is None else value) - error)
    return scene.with_camera(camera, type(spec).model_validate({**spec.model_dump(), key: changed}))
