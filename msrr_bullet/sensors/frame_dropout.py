"""The frames of a camera that never reach the computer."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from msrr_scenes.messages import seconds
from msrr_scenes.specs.faults import CameraBlackout, Fault


class FrameDropout:
    """Numbers the frames of a camera and draws for every frame whether it is lost.

    One number is drawn per frame even during a blackout, so that other faults do not change the sequence.
    """

    def __init__(
        self, camera: str, probability: float, rng: np.random.Generator, faults: Iterable[Fault] = ()
    ) -> None:
        """Begin with frame 0.

        Args:
            camera: Name of the camera.
            probability: Probability that a frame is lost.
            rng: Generator of the stream ``camera/<name>/dropout``, used by nobody else.
            faults: The faults of the scene; blackouts of other cameras are ignored.
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
