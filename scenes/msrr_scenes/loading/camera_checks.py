"""Checks of cameras: what shutter and lens ask of the renderer, the latency and the rate."""

from __future__ import annotations

from collections.abc import Iterator

from msrr_scenes.geometry.distortion import COEFFICIENTS, Distortion, has_inverse
from msrr_scenes.loading.problems import KeyPath, Problem
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec

#: The renderer that draws the instants of an exposure and the distortion of a lens.
_RENDERER = "raster"


def camera_problems(scene: Scene) -> Iterator[Problem]:
    """Yield settings of cameras that cannot be drawn, or that contradict each other."""
    if scene.perception != "images":
        return
    for name, spec in (("onboard", scene.cameras.onboard), ("overhead", scene.cameras.overhead)):
        if spec is not None:
            yield from _shutter_problems(("cameras", name), spec)
            yield from _lens_problems(scene, name, spec)


def _lens_problems(scene: Scene, name: str, spec: CameraSpec) -> Iterator[Problem]:
    deviations = {key: getattr(getattr(scene.as_built, name), key) for key in COEFFICIENTS}
    distorts = any(deviation.error or deviation.sigma for deviation in deviations.values())
    if distorts and spec.renderer.name != _RENDERER:
        text = (
            f"the renderer {spec.renderer.name!r} draws ideal lenses only, and as_built.{name} distorts; use "
            f"renderer {_RENDERER}, or leave out {', '.join(COEFFICIENTS)} there"
        )
        yield Problem(("cameras", name, "renderer"), text)
    lens = Distortion(**{key: deviation.error or 0.0 for key, deviation in deviations.items()})
    if not has_inverse(spec.pinhole, lens):
        text = (
            f"with {lens} two points of the scene appear at one pixel of the frame, towards its corners; use "
            f"smaller coefficients or a smaller cameras.{name}.hfov_deg"
        )
        yield Problem(("as_built", name), text)


def _shutter_problems(path: KeyPath, spec: CameraSpec) -> Iterator[Problem]:
    interval_ms = 1000.0 / spec.rate_hz
    for key in ("exposure_ms", "rolling_shutter_ms"):
        value = getattr(spec, key)
        if value > 0.0 and spec.renderer.name != _RENDERER:
            text = (
                f"the renderer {spec.renderer.name!r} draws one instant only; use renderer {_RENDERER}, or "
                "leave it out"
            )
            yield Problem((*path, key), text)
        if value > interval_ms:
            text = (
                f"it cannot exceed the time between two frames, {interval_ms:.4g} ms, found {value:g}; lower "
                "it or rate_hz"
            )
            yield Problem((*path, key), text)
    after_ms = 0.5 * (spec.exposure_ms + spec.rolling_shutter_ms)
    if after_ms > spec.latency_ms:
        text = (
            f"by exposure_ms and rolling_shutter_ms a frame is complete {after_ms:g} ms after its time "
            f"stamp, and cannot arrive before that, found {spec.latency_ms:g}; raise it"
        )
        yield Problem((*path, "latency_ms"), text)
