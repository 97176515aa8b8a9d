"""Where the samples of an open pixel lie."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Short = NDArray[np.float32]

#: Samples of a pixel that holds an edge. A constant of the compiled code: loops over it become vector code.
SAMPLES = 16

#: Rows of the samples, column by column. Of random permutations, improved by exchanges, the one for which
#: the share of samples on one side of a straight edge is nearest to the area there: over all directions and
#: offsets of the edge, root mean square plus 0.15 times the largest difference is least
#: (0.030 and 0.104 of the contrast; a 4 x 4 grid has 0.028 and 0.12, and 0.125 for every upright edge).
_ROWS = (13, 5, 1, 9, 12, 6, 2, 14, 8, 4, 10, 0, 15, 7, 3, 11)


def rooks() -> Short:
    """Return the N-rooks pattern, shape (2, SAMPLES): x and y in the unit square, all different."""
    places = np.stack([np.arange(SAMPLES) + 0.5, np.array(_ROWS) + 0.5]) / SAMPLES
    return places.astype(np.float32)
