"""The check, before any trial, that the pictures come often enough for what the phase machine waits for."""

from __future__ import annotations

from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.errors import SceneError
from msrr_scenes.specs.scene import Scene


def check_sight(scene: Scene) -> None:
    """Refuse a scene whose units would take a port that they see for lost, or never see one for long enough.

    Raises:
        SceneError: The message names the key and what it has to be.
    """
    camera, docking, frames = scene.cameras.onboard, scene.docking, PhaseTuning().frames
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
            f"docking.verify.time_s: {frames} pictures have to show the seat, which takes {needed_s:.3g} s "
            f"with {camera_text}; raise it to that, found {docking.verify.time_s:g}"
        )
