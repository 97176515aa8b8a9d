"""Compilation of kernels, and the folder in which their machine code is stored.

numba compiles a kernel on its first call, which takes seconds, and can store the result on disk, from where
it loads in tenths of a second. By default it stores beside the source, which a read-only install forbids, and
it detects a stale entry by one file only, although a kernel inlines others. So the folder is chosen here and
named after the contents of the whole package that the kernels are in.

numba keeps machine code by the path of its source, and by when that was written or what is in it. The folder
therefore holds a copy of each source too, and numba is told that the kernel is from there: installations of
one version share their machine code, wherever they lie. Processors do not, for numba tells them apart, and
users do not, for the folder belongs to one.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, partial, update_wrapper, wraps
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., object])


class KernelCompiler:
    """Compiles the kernels of the package in the folder ``sources``."""

    def __init__(self, sources: Path) -> None:
        # Read when the kernels are: an edit before the first compilation must not name their machine code.
        self._contents = _digest(sources)

    @cached_property
    def folder(self) -> Path:
        """Folder of the machine code.

        ``NUMBA_CACHE_DIR`` if the user set it, else the user's cache folder, else a private folder among the
        temporary files, else a temporary folder of this process alone (which then compiles anew).
        """
        import numba
        import numpy

        versions = sys.version_info[:2], numba.__version__, numpy.__version__
        digest = hashlib.sha256(f"{versions} {self._contents}".encode())
        return _folder_for(f"kernels-{digest.hexdigest()[:16]}")

    def is_compiled(self, kernel: Callable[..., object]) -> bool:
        """Return whether the folder has machine code of a kernel (its index; numba checks that it fits)."""
        return any(self.folder.rglob(f"*.{kernel.__name__}-*.nbi"))

    def kernel(self, function: F) -> F:
        """Decorate a function for compilation: cached on disk, one thread, IEEE arithmetic as written.

        ``fastmath`` stays off: results must not depend on how the compiler groups a sum.
        """
        return cast(F, _Lazy(function, self._compiled))

    def variant(self, kernel: F, name: str) -> F:
        """Return a kernel of another name, for arguments of other types.

        It is stored by itself, so :meth:`is_compiled` tells whether there is machine code for those types.
        """
        function: FunctionType = cast(Any, kernel).__wrapped__
        twin = FunctionType(function.__code__.replace(co_name=name), function.__globals__, name)
        twin.__qualname__ = name
        return cast(F, self.kernel(update_wrapper(twin, function, assigned=("__doc__", "__annotations__"))))

    def _compiled(self, function: FunctionType) -> Any:
        from numba.core import config as filled_at_run_time  # mypy sees it as empty

        config: Any = filled_at_run_time
        if not config.DISABLE_JIT:  # a debugger that steps through Python needs the true path
            with suppress(OSError):  # without a copy the machine code is this installation's own
                copy = _copied(Path(function.__code__.co_filename), self.folder)
                function.__code__ = function.__code__.replace(co_filename=str(copy))
        before = config.CACHE_DIR
        config.CACHE_DIR = str(self.folder)
        try:
            return _compiled(function, cache=True)
        finally:
            config.CACHE_DIR = before  # the user's own kernels keep their folder


class _Lazy:
    """A function that is given to numba when it is first called, or when a kernel that calls it is compiled.

    To load numba takes a third as long as all that a check of a scene does, and a check calls no kernel.
    """

    def __init__(self, function: Any, compile_it: Callable[[Any], Any]) -> None:
        update_wrapper(self, function)
        self._function, self._compile = function, compile_it
        self._dispatcher: Any = None

    def _made(self) -> Any:
        from numba.core.compiler_lock import global_compiler_lock

        # The lock that numba holds while it compiles, and asks what is here for the functions that a kernel
        # calls: of two locks, one thread could hold the one and wait for the other, and another vice versa.
        with global_compiler_lock:
            if self._dispatcher is None:
                self._dispatcher = self._compile(self._function)
        return self._dispatcher

    def __call__(self, *arguments: Any) -> Any:
        return (self._made() if self._dispatcher is None else self._dispatcher)(*arguments)

    def __getattr__(self, name: str) -> Any:
        # What numba asks a function that a kernel calls: its type, its options, its Python code.
        return getattr(self._made(), name)


def subroutine(function: F) -> F:
    """Decorate a function that only kernels call: compiled and stored as a part of them.

    Without an entry from Python and machine code of its own, a kernel compiles in less time.
    """
    return cast(F, _Lazy(function, partial(_compiled, no_cpython_wrapper=True, no_cfunc_wrapper=True)))


def inlined(function: F) -> F:
    """Decorate a step of an inner loop: its code is copied into every kernel that calls it.

    A call would count references to every array of every tuple that it passes: more work than the step is.
    """
    return cast(F, _Lazy(function, partial(_compiled, inline="always")))


def chosen_by_type(choose: Callable[..., Callable[..., Any]]) -> Any:
    """Decorate a function that chooses, by the types of its arguments, a step of an inner loop.

    It returns a function of the same arguments, which kernels call in place of the decorated one. So one
    source serves several kinds of data, and no kernel asks which while it runs.

    Args:
        choose: A function of numba's types of the arguments, or of the arguments themselves where numba is
            told not to compile.
    """

    @wraps(choose)
    def chosen(*arguments: Any) -> Any:
        return choose(*arguments)(*arguments)

    _choices.append((chosen, choose))
    return chosen


#: Choices that numba has not been told of yet: it is imported when the first kernel is compiled.
_choices: list[tuple[Callable[..., Any], Callable[..., Callable[..., Any]]]] = []


def _compiled(function: FunctionType, **options: Any) -> Any:
    import numba
    from numba.extending import overload

    while _choices:
        chosen, choose = _choices.pop()
        overload(chosen, strict=False)(choose)  # not strict about annotations, which differ
    return numba.njit(fastmath=False, boundscheck=False, error_model="numpy", **options)(function)


def _user_caches() -> Path:
    """Return the user's folder for caches on this platform."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _digest(sources: Path) -> str:
    """Return a digest of the sources, and of this file, which has the options of the compilation."""
    digest = hashlib.sha256()
    for source in (Path(__file__), *sorted(sources.glob("*.py"))):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()


def _copied(source: Path, folder: Path) -> Path:
    """Return the copy of a file in ``folder``, made if it is not there."""
    copy = folder / source.name
    if not copy.exists():
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as part:
            part.write(source.read_bytes())
        os.utime(part.name, (0, 0))  # older versions of numba ask when a source was written
        os.replace(part.name, copy)  # another process may read it
    return copy


def _usable(folder: Path) -> bool:
    """Create ``folder``; return whether this user alone may write to it, for its contents get executed."""
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
    """Return the first usable candidate for the folder of this name."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    owner = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    candidates = [Path(given)] if given else []
    with suppress(RuntimeError):  # no home folder
        candidates.append(_user_caches() / "msrr-bullet")
    among_temporary_files = Path(tempfile.gettempdir()) / f"msrr-bullet-{owner}"
    # Everybody may create folders there, so another user may have created this one.
    if _usable(among_temporary_files):
        candidates.append(among_temporary_files)
    for candidate in candidates:
        if _usable(candidate / name):
            return candidate / name
    return Path(tempfile.mkdtemp(prefix="msrr-bullet-"))


#: The compiler of the kernels in this package.
compiler = KernelCompiler(Path(__file__).resolve().parent)

kernel = compiler.kernel
