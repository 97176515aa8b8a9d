"""The seeds that a trial can have."""

from __future__ import annotations

from operator import index
from typing import SupportsIndex

#: Largest seed: the store of a sweep keeps seeds as SQLite integers.
MAX_SEED = 2**63 - 1


def checked_seed(seed: SupportsIndex) -> int:
    """Return a seed as an integer.

    Raises:
        TypeError: It is no whole number.
        ValueError: It is below 0 or above :data:`MAX_SEED`.
    """
    if isinstance(seed, bool) or not hasattr(seed, "__index__"):
        raise TypeError(f"a seed is an integer, found {seed!r}")
    number = index(seed)
    if not 0 <= number <= MAX_SEED:
        raise ValueError(f"a seed is a number from 0 to {MAX_SEED}, found {number}")
    return number
