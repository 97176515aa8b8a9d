"""The versions of Python and of the packages that a trial depends on."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version

#: Distributions whose version can change a bit of a trial.
_DISTRIBUTIONS = (
    "msrr-bullet",
    "pybullet",
    "numpy",
    "scipy",
    "opencv-python-headless",
    "pupil-apriltags",
    "python-fcl",
    "numba",
)


@lru_cache(maxsize=1)
def _installed() -> tuple[tuple[str, str], ...]:
    found = [("python", platform.python_version())]
    for name in _DISTRIBUTIONS:
        try:
            found.append((name, version(name)))
        except PackageNotFoundError:
            continue  # an optional distribution that is not installed
    return tuple(found)


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of every installed package that can change a trial."""
    return dict(_installed())
