"""Memory for the most that a picture may need, of which a picture hardly ever needs much."""

from __future__ import annotations

import math
import mmap
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


def untouched(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return an array of zeros whose pages take up memory only from when they are written to.

    An array of :func:`numpy.empty` may lie where something else was before: pages that are in memory already,
    which nothing else gets for as long as the array lives.
    """
    count = math.prod(shape)
    size = count * np.dtype(dtype).itemsize
    return np.frombuffer(mmap.mmap(-1, max(size, 1)), dtype=dtype, count=count).reshape(shape)
