"""Claims about success rates, and rendered views that are degraded by noise and blur to test them."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from msrr_bullet.render import RenderContext, build_renderer
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene

#: Largest probability with which a test of this folder may fail by chance although its claim is true.
LARGEST_FALSE_ALARM = 0.01


@dataclass(frozen=True)
class Claim:
    """The claim that trials succeed at a rate, and the number of successes that the test asks for.

    Attributes:
        what: What is claimed, in words.
        rate: Claimed rate of success.
        trials: Number of trials.
        needed: Number of trials that have to succeed.
    """

    what: str
    rate: float
    trials: int
    needed: int

    def __post_init__(self) -> None:
        assert self.false_alarm <= LARGEST_FALSE_ALARM, (
            f"{self}: would fail by chance in {self.false_alarm:.2%} of all cases"
        )

    @property
    def false_alarm(self) -> float:
        """Probability that the test fails although the rate is the claimed one."""
        return float(binom.cdf(self.needed - 1, self.trials, self.rate))

    @property
    def detectable_rate(self) -> float:
        """Rate below which the test fails in at least 95 of 100 cases."""
        rates = np.linspace(0.0, self.rate, 1001)
        passes = binom.sf(self.needed - 1, self.trials, rates)
        return float(rates[passes <= 0.05].max())

    def __str__(self) -> str:
        return (
            f"claim: {self.what} in at least {self.rate:.0%} of trials; "
            f"asked for {self.needed} of {self.trials}; "
            f"fails by chance in {self.false_alarm:.1e}, detects rates below {self.detectable_rate:.0%}"
        )

    def check(self, successes: Sequence[bool], details: object = "") -> None:
        assert len(successes) == self.trials
        assert sum(successes) >= self.needed, f"{sum(successes)} of {self.trials}. {self}\n{details}"


MakeClaim = Callable[[str, float, int, int], Claim]


@pytest.fixture(scope="session")
def claim() -> MakeClaim:
    """``claim(what, rate, trials, needed)``; refused if it would fail by chance too often."""
    return Claim


@dataclass(frozen=True, eq=False)
class View:
    """The noise-free view of the onboard camera of a unit.

    Attributes:
        X_DU: Pose of the unit in the dock frame.
        ideal: Noise-free pixels of the full frame and a margin on each side.
        margin: Width of that margin, for the largest blur tested [px].
    """

    X_DU: SE2
    ideal: Pixels
    margin: int

    def photograph(self, target: TargetModel, noise_grey: float, blur_px: float, frame: int) -> Pixels:
        """Return the frame that a camera of this noise and blur delivers."""
        sensor = ImageNoise(1, blur_px, noise_grey)
        cut = self.margin - sensor.margin
        ideal = self.ideal[cut : self.ideal.shape[0] - cut, cut : self.ideal.shape[1] - cut]
        return sensor.read_out(np.ascontiguousarray(ideal), target.camera.frame, frame)


@dataclass(frozen=True)
class Gallery:
    """A target and views of it from one range of distances."""

    target: TargetModel
    views: tuple[View, ...]


MakeGallery = Callable[[tuple[float, float], int], Gallery]


@pytest.fixture(scope="session")
def gallery(shipped: Callable[..., Scene]) -> MakeGallery:
    """Render ``count`` views of scene close_range: gaps [m] within limits, up to 12 degrees off the axis."""
    made: dict[tuple[tuple[float, float], int], Gallery] = {}

    def make(gaps: tuple[float, float], count: int) -> Gallery:
        if (gaps, count) not in made:
            made[gaps, count] = _render(shipped, gaps, count)
        return made[gaps, count]

    return make


def _render(shipped: Callable[..., Scene], gaps: tuple[float, float], count: int) -> Gallery:
    scene = shipped("close_range")
    step, spec = scene.plan[0], scene.cameras.onboard
    target = TargetModel.from_scene(scene, step)
    margin = ImageNoise(0, 2.0, 0.0).margin
    rng = stream(11, f"test/views/{gaps}")
    placement = draw_placement(scene, lambda name: stream(0, name))
    views = []
    with (
        tempfile.TemporaryDirectory() as folder,
        BulletWorld(scene, placement, tags=TagVisuals(scene, Path(folder))) as world,
    ):
        renderer = build_renderer(spec.renderer, RenderContext(world.client, spec.samples))
        X_WD = world.pose(step.target_unit) @ scene.dock_frame(step)
        for _ in range(count):
            x = -rng.uniform(*gaps) - target.front
            side, off = np.radians(rng.uniform(-12.0, 12.0, 2))
            X_DU = SE2(x, -x * math.tan(side), -side + 0.5 * off)
            world.place(step.unit, X_WD @ X_DU, (0.0, 0.0))
            X_WC = SE3.from_se2(X_WD @ X_DU) @ target.X_UC
            window = target.camera.frame.padded(margin)
            views.append(View(X_DU, renderer.render(target.camera, X_WC, window), margin))
    return Gallery(target, tuple(views))
