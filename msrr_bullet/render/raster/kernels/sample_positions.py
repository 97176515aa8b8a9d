"""Positions of the samples in a pixel."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.records import Floats

#: Samples with depth of a pixel in which faces meet, and samples of a pixel in which cells of one texture
#: meet, which are cheap and decide how well a tag is located. Constants of the compiled code: loops over
#: them become vector code.
SAMPLES = 16
CELL_SAMPLES = 32

#: Rows of the samples, column by column. Of random permutations, improved by exchanges, the ones for which
#: the share of samples on one side of a straight edge is nearest to the area there: over all directions and
#: offsets of the edge, root mean square plus 0.15 times the largest difference is least. These two are 0.030
#: and 0.104, 0.018 and 0.065 of the contrast; a 4 x 4 grid has 0.028 and 0.12, and 0.125 for upright edges.
_ROWS = {
    SAMPLES: (13, 5, 1, 9, 12, 6, 2, 14, 8, 4, 10, 0, 15, 7, 3, 11),
    CELL_SAMPLES: (
        *(13, 22, 3, 27, 7, 15, 31, 20, 1, 9, 26, 14, 19, 8, 2, 25),
        *(30, 11, 21, 16, 4, 28, 10, 23, 0, 17, 6, 12, 29, 24, 18, 5),
    ),
}


def sample_positions(count: int) -> Floats:
    """Return an N-rooks pattern, shape (2, count): x and y in the unit square, no two of them equal.

    Args:
        count: :data:`SAMPLES` or :data:`CELL_SAMPLES`.
    """
    positions = np.stack([np.arange(count) + 0.5, np.array(_ROWS[count]) + 0.5]) / count
    return positions.astype(np.float32)
