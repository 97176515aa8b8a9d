"""Camera frames of a short run, and the pixels of figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from msrr_bullet.figures.drawing.canvas import bgr
from msrr_bullet.figures.frames.annotation import DrawingContext
from msrr_bullet.log import Log
from msrr_bullet.timeline.camera_views import CameraView, read_camera_views, read_exposures
from msrr_bullet.timeline.interpolation import SnapshotInterpolator
from msrr_bullet.timeline.snapshot import Snapshot


@pytest.fixture(scope="session")
def trial(short_snapshots: list[Snapshot]) -> SnapshotInterpolator:
    return SnapshotInterpolator(short_snapshots)


@pytest.fixture(scope="session")
def context(short_log: Log) -> DrawingContext:
    return DrawingContext(short_log.header.scene, short_log.header.seed)


@pytest.fixture(scope="session")
def views(short_log: Log) -> list[CameraView]:
    """Every sixth frame of both cameras."""
    return list(read_camera_views(short_log, read_exposures(short_log)[::6]))


@pytest.fixture(scope="session")
def count_pixels() -> Callable[..., int]:
    def count(image: np.ndarray | Path, colour: int, tolerance: int = 40) -> int:
        """Count the pixels of about this colour; smooth lines hardly ever have exactly their colour."""
        pixels = cv2.imread(str(image)) if isinstance(image, Path) else image
        return int((np.abs(pixels.astype(int) - bgr(colour)).max(axis=2) <= tolerance).sum())

    return count
