"""One text of a law for one robot and for a thousand trials: arithmetic on numbers or on arrays.

Numpy takes half a microsecond for an operation, be it on two numbers or a thousand; Python takes a tenth of
that for one. So a law takes its vectors apart (:func:`split`), computes with their components, and puts the
outcome together again (:func:`join`): the components of one robot are floats, those of many trials arrays.
Where the last bit of Python's own functions differs from numpy's, it is numpy's in both. Bounds are numbers,
a lower one not above an upper one, and arguments lie in a function's domain: beyond, the two need not agree.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array

#: A float, or an array with one element for each trial.
Number = TypeVar("Number", float, Array)


def split(vectors: Array) -> list[Any]:
    """Return the components of vectors, shape (..., N): floats of a single one, else arrays (...)."""
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
    return scalars.item() if isinstance(scalars, np.ndarray) and scalars.ndim == 0 else scalars


def limit(value: Number, low: Number | float, high: Number | float) -> Number:
    """Return ``value`` within two bounds; what is no number stays none."""
    if isinstance(value, float):
        return low if value < low else high if value > high else value
    return np.minimum(np.maximum(value, low), high)


def at_least(value: Number, low: Number | float) -> Number:
    """Return the larger of a value and its bound; what is no number stays none."""
    if isinstance(value, float):
        return low if value < low else value
    return np.maximum(value, low)


def at_most(value: Number, high: Number | float) -> Number:
    """Return the smaller of a value and its bound; what is no number stays none."""
    if isinstance(value, float):
        return high if value > high else value
    return np.minimum(value, high)


def where(condition: Any, one: Any, other: Any) -> Any:
    """Return ``one`` where the condition holds, else ``other``."""
    if isinstance(condition, bool):
        return one if condition else other
    return np.where(condition, one, other)


def sin(x: Number) -> Number:
    """Return the sine."""
    return float(np.sin(x)) if isinstance(x, float) else np.sin(x)


def cos(x: Number) -> Number:
    """Return the cosine."""
    return float(np.cos(x)) if isinstance(x, float) else np.cos(x)


def tan(x: Number) -> Number:
    """Return the tangent."""
    return float(np.tan(x)) if isinstance(x, float) else np.tan(x)


def tanh(x: Number) -> Number:
    """Return the hyperbolic tangent."""
    return float(np.tanh(x)) if isinstance(x, float) else np.tanh(x)


def exp(x: Number) -> Number:
    """Return the exponential."""
    return float(np.exp(x)) if isinstance(x, float) else np.exp(x)


def log1p(x: Number) -> Number:
    """Return the logarithm of 1 + x."""
    return float(np.log1p(x)) if isinstance(x, float) else np.log1p(x)


def sqrt(x: Number) -> Number:
    """Return the square root."""
    return math.sqrt(x) if isinstance(x, float) else np.sqrt(x)


def hypot(x: Number, y: Number) -> Number:
    """Return the length of the vector (x, y)."""
    return float(np.hypot(x, y)) if isinstance(x, float) else np.hypot(x, y)


def power(x: Number, exponent: float) -> Number:
    """Return a power of numbers that are not negative."""
    return float(np.power(x, exponent)) if isinstance(x, float) else np.power(x, exponent)
