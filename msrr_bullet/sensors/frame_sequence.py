"""The frames of a camera: which are lost, the times of exposure that they state, and when they arrive."""

from __future__ import annotations

from collections.abc import Iterable

from msrr_bullet.sensors.schedule import duration_ns
from msrr_scenes.as_built import BuiltCamera
from msrr_scenes.messages import Exposure, seconds
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.faults import CameraBlackout, Fault
from msrr_scenes.specs.sensors import CameraSpec


class FrameSequence:
    """The clock of a camera as it was built, the frames that it loses, and the latency with its jitter.

    One number is drawn per frame even during a blackout, so that blackouts do not change the sequence.
    """

    def __init__(
        self, camera: str, spec: CameraSpec, built: BuiltCamera, seed: int, faults: Iterable[Fault] = ()
    ) -> None:
        """Start with frame 0.

        ``spec`` has the latency and how likely a frame is lost, ``built`` the offset of the clock and the
        largest delay beyond the latency; smaller ones are as likely. Loss and jitter use separate random
        streams of the seed, and blackouts of other cameras are ignored.
        """
        self._camera, self._built = camera, built
        self._dropout = spec.dropout
        self._latency_ns = duration_ns(spec.latency_ms * 1e-3)
        self._losses = stream(seed, f"camera/{camera}/dropout")
        self._jitter = stream(seed, f"camera/{camera}/jitter")
        self._blackouts = [f for f in faults if isinstance(f, CameraBlackout) and f.camera == camera]
        self._frames = 0

    def expose(self, now_ns: int) -> Exposure | None:
        """Return the frame that is exposed at ``now_ns``; None when it is lost, which is counted too."""
        frame = self._frames
        self._frames += 1
        dropped = self._losses.random() < self._dropout
        if dropped or any(f.from_s <= seconds(now_ns) < f.to_s for f in self._blackouts):
            return None
        return Exposure(self._camera, frame, self._built.stamp(now_ns))

    def next_latency_ns(self) -> int:
        """Return how long the next frame is under way; one number is drawn for each."""
        return self._latency_ns + round(self._built.jitter_ns * float(self._jitter.random()))
