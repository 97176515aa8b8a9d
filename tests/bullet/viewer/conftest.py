"""A browser that opens pages, and what its pictures show."""

from __future__ import annotations

import os
import shutil
import subprocess

import cv2
import numpy as np
import pytest

from msrr_bullet.timeline import palette
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.pinhole import Window

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SIZE = (1280, 800)
#: The part of the page that shows the scene: beside the readings on the left, above the bar at the bottom.
STAGE = Window(270, 30, 1000, 680)


class Browser:
    """Chromium without a window, and what its pictures of a page show.

    Attributes:
        console: Lines that the last page wrote to its console.
    """

    def __init__(self):
        self.console = []

    def screenshot(self, url, tmp_path, budget_ms=4000):
        """Return the page as an image (800, 1280, 3), RGB."""
        picture = tmp_path / "page.png"
        profile = tmp_path / "profile"
        options = [
            *("--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking"),
            *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-sandbox"),
            *("--hide-scrollbars", f"--window-size={SIZE[0]},{SIZE[1]}", f"--user-data-dir={profile}"),
            *(f"--virtual-time-budget={budget_ms}", f"--screenshot={picture}", "--enable-logging=stderr"),
        ]
        done = subprocess.run(
            [CHROMIUM, *options, url],
            check=True,
            timeout=120,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
        return cv2.imread(str(picture))[:, :, ::-1]

    def stage(self, image):
        return image[STAGE.y : STAGE.y_end, STAGE.x : STAGE.x_end].astype(int)

    def pixels_of(self, image, colour):
        """Count the pixels of the stage that have exactly this colour, as drawings have it."""
        wanted = [(colour >> shift) & 255 for shift in (16, 8, 0)]
        return int((np.abs(self.stage(image) - wanted).max(axis=2) <= 2).sum())

    def pixels_of_hue(self, image, colour):
        """Count the saturated pixels of the stage that have the hue of a colour, as lit bodies have it."""
        wanted = np.array([[[(colour >> shift) & 255 for shift in (16, 8, 0)]]], dtype=np.uint8)
        hue = int(cv2.cvtColor(wanted, cv2.COLOR_RGB2HSV)[0, 0, 0])
        hsv = cv2.cvtColor(self.stage(image).astype(np.uint8), cv2.COLOR_RGB2HSV).astype(int)
        return int(((np.abs(hsv[..., 0] - hue) <= 4) & (hsv[..., 1] > 90)).sum())

    def tags_in(self, image):
        grey = np.ascontiguousarray(self.stage(image).astype(np.uint8).mean(axis=2).round().astype(np.uint8))
        return {
            tag.tag_id for tag in PupilDetector().detect(grey, Window(0, 0, grey.shape[1], grey.shape[0]))
        }

    def assert_shows_the_trial(self, image, scene):
        assert self.pixels_of(image, palette.PATH) > 200, "driven path"
        assert self.pixels_of(image, palette.BELIEF) > 200, "believed path and ghost"
        assert self.pixels_of(image, palette.SIGHT) > 100, "camera and line of sight"
        assert self.pixels_of_hue(image, palette.DOCKING_UNIT) > 1000, "docking unit"
        # The tags are the right ones and the right way round: the detector reads them off the page.
        top = {scene.tag_ids(unit)["tag_top"] for unit in scene.units}
        assert top <= self.tags_in(image)


@pytest.fixture(scope="session")
def browser() -> Browser:
    """Chromium without a window. Tests that use it are skipped where there is none."""
    if CHROMIUM is None and not os.environ.get("MSRR_REQUIRE_CHROMIUM"):
        # `make test` cannot install Chromium, which is no Python package; CI does, and requires it.
        pytest.skip("no Chromium on this machine to open the page with")
    return Browser()
