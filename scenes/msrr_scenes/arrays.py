"""The array type of the whole project."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Array of double-precision numbers; every use states the shape, the unit and the frame.
Array = NDArray[np.float64]
