"""The loss of camera frames on the way to the computer."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from msrr_scenes.messages import seconds
from msrr_scenes.specs.faults import CameraBlackout, Fault


class FrameDropout:
    """A counter of the frames of a camera that also draws which of them are lost.

    One number is drawn per frame even during a blackout, so that blackouts do not change the sequence.
    """

    def __init__(
        self, camera: str, probability: float, rng: np.random.Generator, faults: Iterable[Fault] = ()
    ) -> None:
        """Start with frame 0.

        Args:
            camera: Name of the camera.
            probability: Probability that a frame is lost.
            rng: Generator of the stream ``camera/<name>/dropout``, used by no other object.
            faults: Faults of the scene; blackouts of other cameras are ignored.
        """
        self._probability = probability
        self._rng = rng
        self._blackouts = [f for f in faults if isinstance(f, CameraBlackout) and f.camera == camera]
        self._frames = 0

    def next_frame(self, stamp_ns: int) -> tuple[int, bool]:
        """Return the number of the frame that is exposed at ``stamp_ns``, and whether it is lost."""
        frame = self._frames
        self._frames += 1
        dropped = self._rng.random() < self._probability
        return frame, dropped or any(f.from_s <= seconds(stamp_ns) < f.to_s for f in self._blackouts)
