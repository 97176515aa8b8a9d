"""Arithmetic on numbers or on arrays, so that one text of a law serves one robot and a thousand trials.

Numpy takes half a microsecond for an operation, be it on two numbers or on a thousand; Python takes a tenth
of that for one. A law therefore takes its vectors apart (:func:`split`), computes with their components, and
puts the results together again (:func:`join`): the components of one robot are floats, those of many trials
are arrays. Where the last bit of Python's own functions differs from numpy's, both use numpy's. Bounds are
numbers, a lower one not above an upper one, and arguments lie in a function's domain; outside of that the
results for floats and arrays may differ.

Numpy takes sine, cosine and length from the C library, as Python does, so that for these a float needs no
numpy; its other functions have code of their own.
"""

from __future__ import annotations

import math
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array

#: A float, or an array with one element for each trial.
Number = TypeVar("Number", float, Array)

_NUMPY = (np.ndarray, np.generic)

#: Keeps tan below its pole; tanh of it is 1 to all digits.
_BELOW_ONE = 1.0 - 1e-6


class _Function(Protocol):
    """A function of one number that gives a float for a float and an array for an array."""

    def __call__(self, x: Number, /) -> Number: ...


def _elementwise(ufunc: np.ufunc) -> _Function:
    """Return a function of numpy's for floats and for arrays."""

    def apply(x: Any) -> Any:
        return float(ufunc(x)) if isinstance(x, float) else ufunc(x)

    return apply


tan, tanh, exp, log1p = map(_elementwise, (np.tan, np.tanh, np.exp, np.log1p))


def sin(x: Number) -> Number:
    """Return the sine of an angle [rad]."""
    return math.sin(x) if isinstance(x, float) else np.sin(x)


def cos(x: Number) -> Number:
    """Return the cosine of an angle [rad]."""
    return math.cos(x) if isinstance(x, float) else np.cos(x)


def split(vectors: Array) -> list[Any]:
    """Return the components of vectors of shape (..., N): floats for a single vector, else arrays (...)."""
    if vectors.ndim == 1:
        components: list[Any] = vectors.tolist()
        return components
    return [vectors[..., i] for i in range(vectors.shape[-1])]


def join(*components: Any) -> Array:
    """Return the vectors, shape (..., N), that have these components, all floats or all of shape (...)."""
    if isinstance(components[0], float):
        return np.array(components)
    vectors = np.empty((*components[0].shape, len(components)))
    for i, component in enumerate(components):
        vectors[..., i] = component
    return vectors


def number(scalars: NDArray[Any] | float) -> Any:
    """Return an array of shape () as a plain number, anything else as it is."""
    return scalars.item() if isinstance(scalars, _NUMPY) and scalars.ndim == 0 else scalars


def limit(value: Number, low: Number | float, high: Number | float) -> Number:
    """Return ``value`` held between two bounds; NaN stays NaN."""
    if isinstance(value, float):
        return low if value < low else high if value > high else value
    return np.minimum(np.maximum(value, low), high)


def at_least(value: Number, low: Number | float) -> Number:
    """Return the larger of ``value`` and its lower bound; NaN stays NaN."""
    if isinstance(value, float):
        return low if value < low else value
    return np.maximum(value, low)


def at_most(value: Number, high: Number | float) -> Number:
    """Return the smaller of ``value`` and its upper bound; NaN stays NaN."""
    if isinstance(value, float):
        return high if value > high else value
    return np.minimum(value, high)


def where(condition: Any, one: Any, other: Any) -> Any:
    """Return ``one`` where the condition holds, else ``other``."""
    if isinstance(condition, bool):
        return one if condition else other
    return np.where(condition, one, other)


def sqrt(x: Number) -> Number:
    """Return the square root."""
    return math.sqrt(x) if isinstance(x, float) else np.sqrt(x)


def copysign(x: Number, sign: Number) -> Number:
    """Return the magnitude of ``x`` with the sign of ``sign``."""
    return math.copysign(x, sign) if isinstance(x, float) else np.copysign(x, sign)


def sinc(x: Number) -> Number:
    """Return sin(x) / x, which is 1 at 0."""
    if isinstance(x, float):
        return sin(x) / x if x != 0.0 else 1.0
    return np.where(x != 0.0, np.sin(x) / np.where(x != 0.0, x, 1.0), 1.0)


def hypot(x: Number, y: Number) -> Number:
    """Return the length of the vector (x, y)."""
    # The C library's; math.hypot differs from it in the last bit.
    return abs(complex(x, y)) if isinstance(x, float) else np.hypot(x, y)


def atan2(y: Number, x: Number) -> Number:
    """Return the direction of the vector (x, y) [rad], in [-pi, pi]."""
    return float(np.arctan2(y, x)) if isinstance(x, float) else np.arctan2(y, x)


def tanh_tan(share: Number) -> Number:
    """Return tanh(tan(pi/2 share)), the force of eqs. 15 and 22; the share is held between 0 and 1."""
    return tanh(tan((0.5 * math.pi) * limit(share, 0.0, _BELOW_ONE)))
