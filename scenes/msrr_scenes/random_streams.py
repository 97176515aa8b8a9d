"""Random streams keyed by stable names: adding or removing one leaves all others unchanged."""

from __future__ import annotations

import hashlib

import numpy as np


def stream_key(seed: int, name: str) -> int:
    """Return 128 bits that depend on the trial's seed and the stream's name alone."""
    digest = hashlib.blake2b(f"{seed}/{name}".encode(), digest_size=16).digest()
    return int.from_bytes(digest, "little")


def stream(seed: int, name: str) -> np.random.Generator:
    """Return a new generator of a named stream, e.g. ``unit/a/odometry``."""
    return np.random.Generator(np.random.PCG64(stream_key(seed, name)))
