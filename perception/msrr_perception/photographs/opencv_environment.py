"""What OpenCV takes from the environment when it is loaded, so that this comes before it in every program."""

from __future__ import annotations

import os

#: Largest number of pixels of a picture: four times those of the largest camera of a telephone.
MOST_PIXELS = 2**27


def set_opencv_environment() -> None:
    """Have OpenCV refuse larger pictures before it needs memory for them, and report no error by itself.

    What the user has set stays. Nothing changes where OpenCV is loaded already.
    """
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
