"""The times of the frames of a camera: the stamp of its clock, and how long a frame is under way."""

from __future__ import annotations

import numpy as np

from msrr_bullet.sensors.schedule import duration_ns
from msrr_scenes.as_built import BuiltCamera
from msrr_scenes.specs.sensors import CameraSpec


class FrameTiming:
    """The clock of a camera as it was built, and the latency of its data sheet with a jitter."""

    def __init__(self, spec: CameraSpec, built: BuiltCamera, rng: np.random.Generator) -> None:
        """Prepare the draw of the jitter.

        Args:
            spec: Data sheet of the camera.
            built: Offset of the clock, and largest delay beyond the latency; smaller ones are as likely.
            rng: Generator of the stream ``camera/<name>/jitter``, used by no other object.
        """
        self._built = built
        self._latency_ns = duration_ns(spec.latency_ms * 1e-3)
        self._rng = rng

    def stamp(self, now_ns: int) -> int:
        """Return the time of exposure that a frame exposed at ``now_ns`` states."""
        return self._built.stamp(now_ns)

    def next_latency_ns(self) -> int:
        """Return how long the next frame is under way; one number is drawn for each."""
        return self._latency_ns + round(self._built.jitter_ns * float(self._rng.random()))
