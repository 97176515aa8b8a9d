"""Display of a trial in a browser: live while it runs, and as a self-contained page that replays it."""

from msrr_bullet.viewer.live import LiveViewer, ViewerError
from msrr_bullet.viewer.replay_page import write_replay

__all__ = ["LiveViewer", "ViewerError", "write_replay"]
