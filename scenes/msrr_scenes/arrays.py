"""The array type of the whole project."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: An array of double-precision numbers; every use states shape, unit and frame.
Array = NDArray[np.float64]


def read_only(array: Array) -> Array:
    """Return a view of an array that cannot be written through."""
    view = array.view()
    view.flags.writeable = False
    return view
