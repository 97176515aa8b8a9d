"""Images of the cameras of a running trial: which are drawn, and from what is known of the trial."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.interpolation import SnapshotInterpolator
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.timeline.still import Still
from msrr_scenes.messages import NS_PER_S

#: Largest rate of the images of one camera in wall-clock time [Hz], and share of the time that they may take.
MAX_RATE, MAX_SHARE = 5.0, 0.1
#: Time for which every snapshot is kept [ns], longer than an image takes to be read; older ones are kept for
#: the ways, one in each interval [ns].
_RECENT_NS, _WAY_NS = NS_PER_S, NS_PER_S // 10


#: Returns the still of a frame of a trial, which is known at least up to the time of the frame;
#: :func:`msrr_bullet.figures.frames.stills.live_stills` gives one.
StillDrawer = Callable[[CameraView, SnapshotInterpolator], Still]


class LiveCameras:
    """Draws the images of all cameras, each as often as the rate and the share of the time allow."""

    def __init__(self, drawer: StillDrawer) -> None:
        """Draw with ``drawer``."""
        self._drawer = drawer
        self._older: list[Snapshot] = []
        self._recent: deque[Snapshot] = deque()
        self._due: dict[str, float] = {}  # by camera, in the time of the monotonic clock [s]

    def add(self, snapshot: Snapshot) -> None:
        """Take in the next instant of the trial."""
        self._recent.append(snapshot)
        while self._recent[0].stamp_ns < snapshot.stamp_ns - _RECENT_NS:
            old = self._recent.popleft()
            if not self._older or old.stamp_ns >= self._older[-1].stamp_ns + _WAY_NS:
                self._older.append(old)

    def wants(self, camera: str) -> bool:
        """Return whether an image of a camera may be drawn now."""
        return bool(self._recent) and time.monotonic() >= self._due.get(camera, 0.0)

    def draw(self, view: CameraView) -> Still:
        """Return the image of a frame."""
        started = time.monotonic()
        still = self._drawer(view, SnapshotInterpolator([*self._older, *self._recent]))
        took = time.monotonic() - started
        self._due[view.exposure.camera] = started + max(1.0 / MAX_RATE, took / MAX_SHARE)
        return still
