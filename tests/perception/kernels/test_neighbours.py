"""Light of what lies beside the borders of a tag, in sections that are drawn exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import erf

from msrr_perception.kernels.compiled import kernel
from msrr_perception.kernels.edges import refine_corners
from msrr_perception.kernels.neighbours import (
    NEIGHBOUR_MODULES,
    SAMPLES,
    blur_of,
    gain_of,
    spread_of,
    without_neighbours,
)
from msrr_scenes.geometry.pinhole import Window
from tests.perception.conftest import plate, warp

#: Grey levels of black, and of white.
BLACK, WHITE = 20.0, 180.0

#: Module, half-length of the section, and blur of the lens [px]: as of tags at 0.6 m, 0.3 m and 1 m.
SECTIONS = [(2.7, 1.35, 1.131), (4.5, 2.25, 1.131), (4.5, 2.25, 1.5), (1.8, 1.15, 0.4)]


def profile(
    x: np.ndarray, module: float, blur: float, inside: float = BLACK, outside: float = WHITE, off: float = 0.0
) -> np.ndarray:
    """Return the grey levels across an edge that lies at ``off``: four levels, blurred."""
    share = [0.5 + 0.5 * erf((x - off - k * module) / (blur * math.sqrt(2.0))) for k in (-1, 0, 1)]
    return np.asarray(
        inside + (BLACK - inside) * share[0] + (WHITE - BLACK) * share[1] + (outside - WHITE) * share[2]
    )


def levels(greys: np.ndarray) -> tuple[float, float, float]:
    """Return the levels at both ends of a section, and its mean, as the kernel does."""
    return float(greys[:2].mean()), float(greys[-2:].mean()), float(np.trapezoid(greys) / (SAMPLES - 1))


@kernel
def cleaned(
    blur_px: float,
    module: float,
    reach: float,
    black: float,
    white: float,
    mean: float,
    inside: float,
    outside: float,
) -> tuple[float, float, float]:
    spread = spread_of(blur_px, module, reach)
    return without_neighbours(spread, black, white, mean, inside, outside)


@kernel
def reached(blur_px: float, module: float, reach: float) -> bool:
    return spread_of(blur_px, module, reach).reached


@pytest.mark.parametrize(("module", "reach", "blur_px"), SECTIONS)
@pytest.mark.parametrize(
    ("inside", "outside"), [(WHITE, WHITE), (BLACK, 40.0), (WHITE, 40.0), (100.0, 230.0)]
)
def test_a_section_is_as_if_the_borders_went_on(
    module: float, reach: float, blur_px: float, inside: float, outside: float
) -> None:
    """What is left is a hundredth of the contrast, and 6 % of what the neighbours would move the edge."""
    blur, x = blur_of(blur_px, module), np.linspace(-reach, reach, SAMPLES)
    middles = np.array([-1.0, 1.0]) * NEIGHBOUR_MODULES * module
    seen = levels(profile(x, module, blur, inside, outside))
    alone = levels(profile(x, module, blur))
    beside = profile(middles, module, blur, inside, outside)
    found = cleaned(blur_px, module, reach, *seen, *beside.tolist())
    assert np.abs(np.subtract(found, alone)).max() < 0.01 * (WHITE - BLACK)
    before, after = (abs(mean - 0.5 * (black + white)) for black, white, mean in (seen, found))
    assert after < max(0.06 * before, 0.05)


@pytest.mark.parametrize(("module", "reach", "blur_px"), SECTIONS)
def test_a_short_section_shows_a_part_of_the_shift(module: float, reach: float, blur_px: float) -> None:
    """An edge that is off by 0.02 px, without neighbours; the trapezium rule leaves 2 %."""
    blur, x = blur_of(blur_px, module), np.linspace(-reach, reach, SAMPLES)
    black, white, mean = levels(profile(x, 100.0, blur, off=0.02))
    said = 2.0 * reach * (0.5 * (black + white) - mean) / (white - black)
    assert said / 0.02 == pytest.approx(gain_of(blur, reach), abs=0.02)


def test_a_neighbour_that_is_far_is_not_asked_for() -> None:
    assert reached(1.0, 4.0, 2.0)
    assert not reached(0.4, 6.0, 3.0)


@pytest.mark.parametrize("told_px", [0.0, 0.8, 1.6, 20.0])
def test_a_blur_that_was_told_wrong_leads_no_corner_away(told_px: float) -> None:
    """Sharp pictures of tags of 24 px: fits settle, at a larger error than with the true blur.

    Measured: 0.007, 0.05, 0.12 and 0.16 px RMS. A fit that does not settle keeps no tag, or ends anywhere
    within 2 px.
    """
    rng, window = np.random.default_rng(6), Window(0, 0, 60, 60)
    errors = []
    for i in range(12):
        square = 12.0 * np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]]) + 30.0
        square += rng.uniform(-0.5, 0.5, 2) + rng.normal(0.0, 0.3, (4, 2))
        image = warp(window, [(plate(i), square)])
        (found,), (measured,), _ = refine_corners(
            image, square[None] + rng.uniform(-0.3, 0.3, (1, 4, 2)), blur_px=told_px
        )
        assert measured
        errors.append(found - square)
    assert np.sqrt(np.mean(np.square(errors))) < 0.25
