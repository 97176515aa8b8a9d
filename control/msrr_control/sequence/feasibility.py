"""The check, before any trial, that what a scene tells the phase machine can work at all."""

from __future__ import annotations

import math

from msrr_control.docking.law import DockSetup
from msrr_control.sequence.tuning import PhaseTuning
from msrr_control.sequence.verification import MOVED
from msrr_scenes.errors import SceneError
from msrr_scenes.specs.scene import Scene

#: Standard deviations of the backlash that a tug has to be longer than: one drive of 370 has more.
_SIGMAS = 3.0


def check_sequence(scene: Scene) -> None:
    """Refuse a scene whose units could not dock, or try again, whatever they see.

    They would take a port that they see for lost, never see a seat for long enough, take up no more than
    the backlash of their drives in a tug test, or not back out of the port.

    Raises:
        SceneError: The message names the key and what it has to be.
        GeometryError: A URDF lacks a frame, or the pins or holes, of a step.
    """
    tuning = PhaseTuning()
    _check_sight(scene, tuning.frames)
    _check_tug(scene)
    for step in scene.possible_docks:
        least_m = DockSetup.of(scene, step).pin_reach + tuning.retreat.clear_m + tuning.arrived_m
        if scene.docking.retreat_m < least_m:
            raise SceneError(
                f"docking.retreat_m: a unit has left {step.to} when it is {_rounded_up(least_m)} m away; "
                f"raise it to that, found {scene.docking.retreat_m:g}"
            )


def _check_sight(scene: Scene, frames: int) -> None:
    """Refuse a camera whose pictures come too late or too seldom."""
    camera, docking = scene.cameras.onboard, scene.docking
    late_s, period_s = 1e-3 * camera.latency_ms, 1.0 / camera.rate_hz
    camera_text = f"a camera at {camera.rate_hz:g} Hz whose pictures come {camera.latency_ms:g} ms late"
    oldest_s = late_s + period_s
    if docking.lost_time_s <= oldest_s:
        raise SceneError(
            f"docking.lost_time_s: with {camera_text}, the last one is up to {oldest_s:.3g} s old; raise it "
            f"above that, found {docking.lost_time_s:g}"
        )
    needed_s = late_s + frames * period_s
    if docking.verify.by_sight and docking.verify.time_s < needed_s:
        raise SceneError(
            f"docking.verify.time_s: {frames} pictures have to show the seat, which takes "
            f"{_rounded_up(needed_s)} s with {camera_text}; raise it to that, found {docking.verify.time_s:g}"
        )


def _check_tug(scene: Scene) -> None:
    """Refuse a tug of which backlash, as far as its tolerance is told, may leave too little to be seen."""
    verify, sigma_deg = scene.docking.verify, scene.as_built.drive.backlash_deg.sigma
    if not (verify.by_sight and verify.tug_m):
        return
    radius = max((scene.geometry(step.unit).wheel_radius for step in scene.possible_docks), default=0.0)
    lost_m = _SIGMAS * math.radians(sigma_deg) * radius
    least_m = lost_m / (1.0 - MOVED)
    if verify.tug_m < least_m:
        raise SceneError(
            f"docking.verify.tug_m: backlash of {sigma_deg:g} deg (1 sigma) of wheels of "
            f"{1e3 * radius:.3g} mm may take up {lost_m:.3g} m, so that a unit that is not held is hardly "
            f"seen to move; raise it to {_rounded_up(least_m)}, or set it to 0 for no tug test, found "
            f"{verify.tug_m:g}"
        )


def _rounded_up(least: float) -> str:
    """Return a least value in three digits that are not less: whoever takes them is not refused again."""
    digit = 10.0 ** (math.floor(math.log10(least)) - 2)
    return f"{math.ceil(least / digit) * digit:.3g}"
