"""The array type of the whole project."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

A = TypeVar("A", bound=NDArray[Any])
T = TypeVar("T", bound=np.generic)

#: An array of double-precision numbers; every use states shape, unit and frame.
Array = NDArray[np.float64]


def frozen(array: A) -> A:
    """Return an array itself, which cannot be written from now on."""
    array.flags.writeable = False
    return array


def read_only(array: NDArray[T]) -> NDArray[T]:
    """Return a view of an array that cannot be written through; whoever has the array still can."""
    return frozen(array.view())
