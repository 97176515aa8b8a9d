"""What lies beside the borders of a tag, and how much of its light a cross section of an edge gets by blur.

Across an edge the grey level has four steps of one module: what the tag shows inside its black border, the
black border, the white border, and what surrounds the tag. A blur of a third of a module or more brings
light of the first and the last into a section that ends in the middle of either border. If they are not as
bright as the borders beside them, that moves the edge: by 0.2 px at modules of 2.7 px and a blur of 1.1 px.
How bright they are shows in the image, and how much of that reaches the section follows from the blur, which
the data sheet of a camera tells. So it is subtracted.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from msrr_perception.kernels.compiled import inlined, subroutine

#: Samples of a cross section; the two at either end tell the levels of black and white.
SAMPLES = 13

#: Middle of what lies beside a border, by its distance from the edge in modules.
NEIGHBOUR_MODULES = 1.5

#: Standard deviation by which pixels and the interpolation between them blur, which have the variances 1/12
#: and 1/6 [px], and the largest blur in modules, beyond which no tag is read.
_PIXEL_PX, _MOST_MODULES = 0.5, 0.6

#: Distance of a neighbour from a section, in deviations of the blur, from which on it gives no light.
_FAR = 4.0


def blur_of(blur_px: float, module: float) -> float:
    """Return the standard deviation of the blur of an edge by lens, pixels and interpolation [px].

    Args:
        blur_px: Standard deviation of the lens blur [px].
        module: Width of a module [px].
    """
    return min(math.hypot(blur_px, _PIXEL_PX), _MOST_MODULES * module)


def gain_of(blur: float, reach: float) -> float:
    """Return the distance by which a section says that an edge is off, by the distance that it is off.

    A section that is shorter than the blurred edge says less: the edge moves light into the levels of black
    and white as well, with which the mean of the section is compared.

    Args:
        blur: Standard deviation of the blur of the edge [px].
        reach: Half-length of the section [px].
    """
    end = reach / blur * math.sqrt(0.5)
    inner = end * (1.0 - 2.0 / (SAMPLES - 1))
    at_levels = end * (math.exp(-end * end) + math.exp(-inner * inner)) / math.sqrt(math.pi)
    return (math.erf(end) - at_levels) / (0.5 * (math.erf(end) + math.erf(inner)))


_blur_of, _gain_of = inlined(blur_of), inlined(gain_of)


class LightSpread(NamedTuple):
    """How blur spreads light over a cross section. All values are shares.

    Attributes:
        reached: Whether light of the neighbours reaches the section.
        across: Light of one border in the samples that tell the level of the other one.
        near: Light of a neighbour in the samples that tell the level of the border beside it.
        whole: Light of a neighbour in the mean of the section.
        border: Light of a border in a sample at the middle of the neighbour beside it.
        gain: See :func:`gain_of`.
    """

    reached: bool
    across: float
    near: float
    whole: float
    border: float
    gain: float


@inlined
def below(z: float) -> float:
    """Return the share of a normal distribution that lies below ``z`` deviations."""
    return 0.5 * math.erfc(-z * math.sqrt(0.5))


@subroutine
def spread_of(blur_px: float, module: float, reach: float) -> LightSpread:
    """Return how blur spreads light over a section.

    Args:
        blur_px: Standard deviation of the lens blur [px].
        module: Width of a module [px].
        reach: Half-length of the section [px].
    """
    blur, step = _blur_of(blur_px, module), 2.0 * reach / (SAMPLES - 1)
    apart, gain = (module - reach) / blur, _gain_of(blur, reach)
    across = 0.5 * (below(-reach / blur) + below((step - reach) / blur))
    if apart > _FAR:
        return LightSpread(False, across, 0.0, 0.0, 0.0, gain)
    near = 0.5 * (below(-apart) + below(-apart - step / blur))
    bell = math.exp(-0.5 * apart * apart) / math.sqrt(2.0 * math.pi)
    whole = 0.5 * blur * (bell - apart * below(-apart)) / reach
    border = below((1.0 - NEIGHBOUR_MODULES) * module / blur)
    return LightSpread(True, across, near, whole, border, gain)


@inlined
def without_neighbours(
    spread: LightSpread, black: float, white: float, mean: float, inside: float, outside: float
) -> tuple[float, float, float]:
    """Return ``black``, ``white`` and ``mean`` without the light of the neighbours.

    Args:
        spread: How blur spreads light over the section.
        black: Grey level at the inner end of the section.
        white: Grey level at its outer end.
        mean: Mean grey level of the section.
        inside: Grey level in the middle of what the tag shows inside its black border.
        outside: Grey level as far outside of its white border.
    """
    # Each level is a mixture of the true ones: solved for those of the borders, then of the neighbours.
    neighbour = spread.near / (1.0 - spread.border)
    own = 1.0 - spread.across - neighbour
    low, high = black - neighbour * inside, white - neighbour * outside
    scale = 1.0 / (own * own - spread.across * spread.across)
    from_inside = (inside - scale * (own * low - spread.across * high)) / (1.0 - spread.border)
    from_outside = (outside - scale * (own * high - spread.across * low)) / (1.0 - spread.border)
    return (
        black - spread.near * from_inside,
        white - spread.near * from_outside,
        mean - spread.whole * (from_inside + from_outside),
    )
