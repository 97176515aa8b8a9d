"""PyBullet, imported without the line that it writes to the terminal when it is imported."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def _silence() -> Iterator[None]:
    # The line is written from C and bypasses sys.stdout, so the file descriptors are redirected.
    sys.stdout.flush()
    sys.stderr.flush()
    kept = {descriptor: os.dup(descriptor) for descriptor in (1, 2)}
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        for descriptor in kept:
            os.dup2(null, descriptor)
        yield
    finally:
        for descriptor, original in kept.items():
            os.dup2(original, descriptor)
            os.close(original)
        os.close(null)


with _silence():
    import pybullet

__all__ = ["pybullet"]
