"""Checks of cameras: calibration, field of view, what shutter and lens ask of renderer, latency and rate."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from msrr_scenes.checks.problems import KeyPath, Problem
from msrr_scenes.geometry.distortion import COEFFICIENTS
from msrr_scenes.geometry.lens import Lens, explained_fold
from msrr_scenes.specs.deviations import Deviation
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import FOV_DEG, CameraSpec

#: The shipped renderer that draws the instants of an exposure and the distortion of a lens. Whether one of a
#: user's own does is known when it is built (:class:`msrr_bullet.sensors.camera.Camera`).
_RENDERER = "raster"

#: The shipped renderer that draws neither.
_IDEAL_RENDERER = "tiny"

#: Greatest ratio of the focal lengths of a calibration.
_MOST_ASPECT = 2.0


def camera_problems(scene: Scene) -> Iterator[Problem]:
    """Yield settings of cameras that cannot be drawn, or that contradict each other."""
    for name, spec in (("onboard", scene.cameras.onboard), ("overhead", scene.cameras.overhead)):
        if spec is None:
            continue
        calibration = list(_calibration_problems(name, spec))
        yield from calibration
        if name == "onboard" and not calibration:
            yield from _cone_problems(scene)
        if not calibration:
            yield from _fold_problems(scene, name, spec)
        if scene.perception == "images":
            yield from _shutter_problems(("cameras", name), spec)
            if not calibration:
                yield from _lens_problems(scene, name, spec)


def _cone_problems(scene: Scene) -> Iterator[Problem]:
    """Yield that the onboard camera sees less than the cone of the line of sight."""
    camera, outer_deg = scene.cameras.onboard, scene.los.outer_deg
    half_fov = math.degrees(camera.lens.half_fov)
    if outer_deg >= half_fov:
        calibrated = camera.calibration is not None
        wider = "use a camera that sees more" if calibrated else "raise cameras.onboard.hfov_deg"
        text = (
            f"the outer bound has to be below half the onboard camera's field of view ({half_fov:.4g} deg), "
            f"found {outer_deg:g}; lower it or {wider}"
        )
        yield Problem(("los", "outer_deg"), text)


def _calibration_problems(name: str, spec: CameraSpec) -> Iterator[Problem]:
    """Yield why a calibration is not that of this camera, or of no camera."""
    told, path = spec.calibration, ("cameras", name, "calibration")
    if told is None:
        return
    for key, size in (("width_px", spec.width_px), ("height_px", spec.height_px)):
        calibrated = getattr(told, key)
        if calibrated not in (None, size):
            text = (
                f"it is of images with {key} = {calibrated}, and those of this camera have {size}; calibrate "
                f"images of that size, or set cameras.{name}.{key}"
            )
            yield Problem(path, text)
    lens = spec.lens
    folds = explained_fold(lens)
    if max(lens.distortion.aspect, 1.0 / lens.distortion.aspect) > _MOST_ASPECT:
        text = f"pixels are nearly square, and fx_px = {told.fx_px:g} is far from fy_px = {told.fy_px:g}"
        yield Problem(path, f"{text}; give both in pixels")
    elif folds is not None:
        yield Problem(path, f"{folds}; use coefficients that describe the whole frame")
    else:
        fov_deg, (low, high) = math.degrees(sum(lens.field_of_view)), FOV_DEG
        if not low < fov_deg < high:
            text = f"it sees {fov_deg:.4g} deg along a row, and {low:g} .. {high:g} deg can be computed with"
            yield Problem(path, f"{text}; give fx_px in pixels")


def _lens_problems(scene: Scene, name: str, spec: CameraSpec) -> Iterator[Problem]:
    """Yield that the renderer draws no lens that distorts, and this one does."""
    told, deviations = spec.lens, _lens_deviations(scene, name)
    if _draws_one_instant(spec):
        text = f"the renderer {spec.renderer.name!r} draws ideal lenses only, and "
        remedy = f"use renderer {_RENDERER}, or"
        if told.distorts:
            text += f"cameras.{name}.calibration is of another one; "
            text += f"{remedy} leave out its coefficients, with fy as fx"
            yield Problem(("cameras", name, "renderer"), text)
        elif any(deviation.error or deviation.sigma for deviation in deviations.values()):
            text += f"as_built.{name} distorts; {remedy} as_built: perfect without {', '.join(COEFFICIENTS)}"
            yield Problem(("cameras", name, "renderer"), text)


def _fold_problems(scene: Scene, name: str, spec: CameraSpec) -> Iterator[Problem]:
    """Yield that the lens which is built shows two points at one pixel, as no lens does."""
    told, deviations = spec.lens, _lens_deviations(scene, name)
    errors = {key: deviation.error or 0.0 for key, deviation in deviations.items()}
    if not any(errors.values()):
        return  # the lens that is told is checked by itself; to do so again takes half as long as a load
    coefficients = {key: getattr(told.distortion, key) + error for key, error in errors.items()}
    folds = explained_fold(Lens(told.camera, replace(told.distortion, **coefficients)))
    if folds is not None:
        text = f"{folds}; use smaller coefficients or a smaller field of view of cameras.{name}"
        yield Problem(("as_built", name), text)


def _lens_deviations(scene: Scene, name: str) -> dict[str, Deviation]:
    """Return by how much the coefficients of the lens that is built differ from those that are told."""
    return {key: getattr(getattr(scene.as_built, name), key) for key in COEFFICIENTS}


def _draws_one_instant(spec: CameraSpec) -> bool:
    """Return whether the renderer of a camera is the shipped one without exposure times and distortion."""
    return spec.renderer.name == _IDEAL_RENDERER


def _shutter_problems(path: KeyPath, spec: CameraSpec) -> Iterator[Problem]:
    interval_ms = 1000.0 / spec.rate_hz
    for key in ("exposure_ms", "rolling_shutter_ms"):
        value = getattr(spec, key)
        if value > 0.0 and _draws_one_instant(spec):
            text = (
                f"the renderer {spec.renderer.name!r} draws one instant only; use renderer {_RENDERER}, or "
                "set it to 0, as as_built: perfect does"
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
