"""What can change a bit of a trial besides scene and seed: the versions of packages, and the machine."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version

import numpy as np

#: Distributions whose version can change a bit of a trial.
_DISTRIBUTIONS = (
    "msrr-bullet",
    "pybullet",
    "numpy",
    "scipy",
    "opencv-python-headless",
    "pupil-apriltags",
    "pyapriltags",
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


def trial_versions() -> dict[str, str]:
    """Return :func:`package_versions` with ``processor`` and ``libc``, whose functions may round otherwise.

    NumPy, OpenBLAS and the C library have code of their own for every generation of processors, which sums in
    another order or rounds once less. ``processor`` therefore names the last SIMD extension that NumPy found.
    """
    extensions = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    libc = " ".join(platform.libc_ver()).strip() or platform.platform(terse=True)
    processor = " ".join([platform.machine(), *extensions[-1:]])
    return {**package_versions(), "processor": processor, "libc": libc}
