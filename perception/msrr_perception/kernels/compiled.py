"""Compilation of kernels, and the folder in which their machine code is kept.

numba compiles a kernel on its first call (seconds) and can keep the result on disk (then: tenths of a
second). Its own choice of folder is beside the source, which a read-only install forbids, and its notion of
a stale entry looks at one file only, although a kernel inlines others. So the folder is chosen here, named
after the contents of the whole package that the kernels are in.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import config as _config

F = TypeVar("F", bound=Callable[..., object])

#: numba fills this module in when it is imported.
_numba_config: Any = _config


class KernelCompiler:
    """Compiles the kernels of one package."""

    def __init__(self, sources: Path) -> None:
        """Compile the kernels in the folder ``sources``."""
        self.sources = sources

    @cached_property
    def folder(self) -> Path:
        """Folder of the machine code.

        ``NUMBA_CACHE_DIR`` if the user set it, else the user's cache folder, else a private folder among the
        temporary files, else a temporary folder of this process alone (which then compiles anew).
        """
        return _folder_for(f"kernels-{_digest(self.sources)}")

    def is_compiled(self) -> bool:
        """Say whether the folder holds machine code already (an index file; numba checks that it fits)."""
        return any(self.folder.rglob("*.nbi"))

    def kernel(self, function: F) -> F:
        """Decorate a function for compilation: cached on disk, one thread, IEEE arithmetic as written.

        ``fastmath`` stays off: results must not depend on how the compiler groups a sum.
        """
        before = _numba_config.CACHE_DIR
        _numba_config.CACHE_DIR = str(self.folder)
        try:
            compile_it = numba.njit(cache=True, fastmath=False, boundscheck=False, error_model="numpy")
            return cast(F, compile_it(function))
        finally:
            _numba_config.CACHE_DIR = before  # the user's own kernels are none of our business


def inlined(function: F) -> F:
    """Decorate a step of an inner loop: its code is copied into every kernel that calls it.

    A call would count references to every array of every tuple that it passes: more work than the step is.
    """
    return cast(F, numba.njit(inline="always", fastmath=False, error_model="numpy")(function))


def _user_caches() -> Path:
    """Return the user's folder for caches, as the platform has it."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _digest(sources: Path) -> str:
    """Return a name for what gets compiled: every source of the package, and the compiler's version."""
    digest = hashlib.sha256(f"numba {numba.__version__}, python {sys.version_info[:2]}".encode())
    for source in sorted(sources.glob("*.py")):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _usable(folder: Path) -> bool:
    """Create ``folder``; say whether we may write there and nobody else may: its contents get executed."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
        if hasattr(os, "getuid") and (status.st_uid != os.getuid() or status.st_mode & stat.S_IWOTH):
            return False
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, RuntimeError):  # read-only, no home folder: the next candidate is tried
        return False
    return True


def _folder_for(name: str) -> Path:
    """Return the first candidate for the folder of this name that can be used."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    owner = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    candidates = [Path(given)] if given else []
    with suppress(RuntimeError):  # no home folder
        candidates.append(_user_caches() / "msrr-bullet")
    among_temporary_files = Path(tempfile.gettempdir()) / f"msrr-bullet-{owner}"
    # Where everybody may create folders, somebody else may have created this one for us.
    if _usable(among_temporary_files):
        candidates.append(among_temporary_files)
    for candidate in candidates:
        if _usable(candidate / name):
            return candidate / name
    return Path(tempfile.mkdtemp(prefix="msrr-bullet-"))


#: Of the kernels in this package.
compiler = KernelCompiler(Path(__file__).resolve().parent)

kernel = compiler.kernel
