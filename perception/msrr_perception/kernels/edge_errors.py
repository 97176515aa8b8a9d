"""How sure an edge is that was measured in an image: by what the image itself shows of it.

The residuals of the cross sections about their line show noise of any cause. Two errors do not show there,
because cross sections have them in common: those by where the edge lies between the pixels, and by what lies
beyond the borders of the tag. Both follow from the length of the cross sections and from the blur, which the
width of the edge shows. Their constants were measured on rendered frames without noise, at tags of 27, 42 and
66 px and 0 to 2 px of blur.
"""

from __future__ import annotations

import math

from msrr_perception.kernels.compiled import inlined

#: Error of a cross section because the edge is sampled in pixels: standard deviation of a sharp edge, and the
#: blur that halves it [px].
SAMPLING_PX, SMOOTH_PX = 0.032, 0.75

#: Half-length of a cross section below which this error grows, with the third power [px].
SHORT_PX = 1.8

#: Error of a cross section because what lies beyond the borders of the tag is blurred into it: deviation
#: at a length of zero [px], and how it falls with the half-length by the blur. First as it is where the blur
#: of the lens is not known, then what is left of it where that light is subtracted, at the tags of a port.
_UNKNOWN_BORDER_PX, _UNKNOWN_BORDER_FALL = 0.9, 1.55
BORDER_PX, BORDER_FALL = 0.25, 1.2

#: Blur by pixels and by interpolation [px].
PIXEL_BLUR_PX = 0.45

#: Variance of a line by that of its residuals: levels and slope of the light are measured by the same pixels.
#: On tags of 45 to 120 px with a noise of 8 grey levels it was 1.2 to 1.6.
_SAME_PIXELS = 1.4

#: Distance of cross sections below which they show the same pixels [px].
_APART_PX = 1.3

#: The integral of g (1 - g) over a Gaussian edge g is its deviation over the root of pi. Over a section that
#: is too short for the edge it ends at this share of half the section, and is known up to a smaller one.
_FULL, _KNOWN = 0.2975, 0.29


@inlined
def edge_blur(overlap: float, reach: float) -> float:
    """Return the standard deviation of the blur of an edge [px].

    Args:
        overlap: Integral over a section of the share of white times that of black [px].
        reach: Half-length of the section [px].
    """
    share = min(max(overlap / reach, 0.0), _KNOWN)
    return math.sqrt(math.pi) * share * reach / math.sqrt(1.0 - (share / _FULL) ** 6)


@inlined
def section_variance(residual: float, overlap: float, reach: float, apart: float, blur_px: float) -> float:
    """Return the variance of a cross section of an edge, of which the line is fitted to many [px^2].

    Args:
        residual: Variance of the cross sections about their line [px^2].
        overlap: Integral over a section of the share of white times that of black [px].
        reach: Half-length of a section [px].
        apart: Distance of two cross sections [px].
        blur_px: Standard deviation of the lens blur [px]; 0 if it is not known.
    """
    blur = max(edge_blur(overlap, reach), 0.1)
    lens = max(blur * blur - PIXEL_BLUR_PX * PIXEL_BLUR_PX, 0.0)
    short = max(SHORT_PX / reach, 1.0) ** 3
    sampling = short * SAMPLING_PX / (1.0 + lens / (SMOOTH_PX * SMOOTH_PX))
    if blur_px > 0.0:
        border = BORDER_PX * math.exp(-BORDER_FALL * reach / blur)
    else:
        border = _UNKNOWN_BORDER_PX * math.exp(-_UNKNOWN_BORDER_FALL * reach / blur)
    noise = _SAME_PIXELS * max(_APART_PX / apart, 1.0) * residual
    return noise + sampling * sampling + border * border
