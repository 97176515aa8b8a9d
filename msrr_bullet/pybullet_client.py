"""Import of PyBullet without the line that PyBullet writes to the terminal when it is imported."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


def load_simulator() -> None:
    """Import PyBullet silently.

    Raises:
        ImportError: PyBullet is not installed.
    """
    if "pybullet" not in sys.modules:
        with _silence():
            importlib.import_module("pybullet")


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
