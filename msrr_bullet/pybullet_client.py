"""Loads PyBullet without the line that it writes to the terminal when it is imported."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


def load_simulator() -> None:
    """Import pybullet; a failure to do so is raised as usual."""
    if "pybullet" not in sys.modules:
        with _silence():
            importlib.import_module("pybullet")


@contextmanager
def _silence() -> Iterator[None]:
    # The line comes from C, past sys.stdout: only the descriptors themselves can hold it back.
    sys.stdout.flush()
    sys.stderr.flush()
    kept = {descriptor: os.dup(descriptor) for descriptor in (1, 2)}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for descriptor in kept:
            os.dup2(nowhere, descriptor)
        yield
    finally:
        for descriptor, original in kept.items():
            os.dup2(original, descriptor)
            os.close(original)
        os.close(nowhere)
