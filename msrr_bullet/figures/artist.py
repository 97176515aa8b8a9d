"""Draws the frames of one run, whichever camera they are of."""

from __future__ import annotations

from msrr_bullet.figures.drawing import DrawingContext, Picture
from msrr_bullet.figures.onboard_frame import draw_onboard
from msrr_bullet.figures.overhead_frame import draw_overhead
from msrr_bullet.log.reader import Log
from msrr_bullet.timeline.camera_views import CameraView, optics
from msrr_bullet.timeline.interpolation import Moments
from msrr_bullet.timeline.log_snapshots import snapshots
from msrr_perception.pose.overhead_model import OVERHEAD
from msrr_scenes.messages import Exposure


class Artist:
    """Draws frames of one run.

    Attributes:
        moments: The run at any time.
        stagecraft: What frames are drawn with.
    """

    def __init__(self, log: Log) -> None:
        """Read the run.

        Raises:
            MsrrError: It ended before the first decision.
        """
        self.moments = Moments(snapshots(log))
        self.stagecraft = DrawingContext(log.header.scene, log.header.seed)

    def draw(self, view: CameraView) -> Picture:
        """Draw on a frame."""
        moment = self.moments.at(view.stamp_ns)
        if view.exposure.camera == OVERHEAD:
            return draw_overhead(self.stagecraft, view, moment, self.moments.until(view.stamp_ns))
        return draw_onboard(self.stagecraft, view, moment)

    def draw_unseen(self, camera: str, stamp_ns: int) -> Picture:
        """Draw what a camera would have had before it at a time at which it did not look.

        Args:
            camera: ``overhead``; anything else is the camera of the unit that docks at the time.
            stamp_ns: The time.
        """
        name = camera
        if camera != OVERHEAD:
            step = self.moments.at(stamp_ns).step
            name = f"{step.unit}/onboard" if step else camera
        return self.draw(CameraView(Exposure(name, -1, stamp_ns), optics(self.stagecraft.scene, name)))
