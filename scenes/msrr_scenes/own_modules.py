"""Modules of a user's own, which a scene names by an import path: their files, and whether these changed.

Python imports a module once. A program that stays, such as a notebook, goes on with the older class when its
file is edited, and nobody would know which of them a result is of.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import os
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from msrr_scenes.errors import ChangedFileError
from msrr_scenes.file_cache import FileCache

#: The packages of this project.
PACKAGES = ("msrr_scenes", "msrr_perception", "msrr_control", "msrr_bullet")


class _Imported(NamedTuple):
    """What a module was when it was imported: a reload gives it another spec."""

    spec: ModuleSpec | None
    digest: bytes


_imported: dict[str, _Imported] = {}


def import_own(module_name: str) -> ModuleType:
    """Import a module of a user's own, which is looked for in the current folder too.

    Raises:
        ChangedFileError: This process has imported it before, and it, or a module that it imports, has been
            edited since, or here it is another file.
        ImportError: It cannot be found or imported; other errors of its own code pass as they are.
    """
    with current_folder_importable():
        _refuse_another_file(module_name.partition(".")[0])
        digest = digest_of(module_name)
        module = importlib.import_module(module_name)
    before = _imported.get(module_name)
    if before is None or before.spec is not module.__spec__ or module.__spec__ is None:  # None: run as it is
        _imported[module_name] = _Imported(module.__spec__, digest)
    elif before.digest != digest:
        raise ChangedFileError(
            f"{_place(module)}, or a module that it imports, was edited after this program imported it; "
            f"start the program again (in a notebook, its kernel), or reload what was edited, {module_name} "
            "last (importlib.reload)"
        )
    return module


def digest_of(module: str, *, imported: bool = False) -> bytes:
    """Return a digest of the files of a module; an empty one has no file.

    If ``imported``, the files count as they were when this process imported the module, if it did.
    """
    before = _imported.get(module) if imported else None
    return _digest(tuple(_files_of(module))) if before is None else before.digest


_digest = FileCache(
    lambda files: (hashlib.blake2b(b"".join(file.read_bytes() for file in files)).digest(), files), most=64
)


def _refuse_another_file(package: str) -> None:
    """Refuse a package or module of which this process has imported one from another folder."""
    module = None if package == "__main__" else sys.modules.get(package)
    found = None if module is None else PathFinder.find_spec(package, sys.path)
    here = None if found is None or found.origin is None else Path(found.origin)
    if module is None or here is None or not getattr(module, "__file__", None):
        return
    there = Path(str(module.__file__))
    if here.resolve() != there.resolve():
        raise ChangedFileError(
            f"{package!r} is {here} here, and this program has imported {there} by that name; start the "
            "program again, or give one of them another name"
        )


def _place(module: ModuleType) -> str:
    return Path(module.__file__).name if module.__file__ else module.__name__


@contextmanager
def current_folder_importable() -> Iterator[None]:
    """Let modules in the current folder be imported, after all others, so that they replace none of them.

    A module that changes the working folder changes it for no one else: runs and stores would lie elsewhere.
    """
    folder = os.getcwd()
    sys.path.append(folder)
    try:
        yield
    finally:
        # By its place from the end, for the folder may be on the path already, and never by sys.path.pop(),
        # for an imported module may have added to the path.
        for index in reversed(range(len(sys.path))):
            if sys.path[index] == folder:
                del sys.path[index]
                break
        if os.getcwd() != folder:
            os.chdir(folder)


def _files_of(module: str) -> list[Path]:
    """Return the file of a module and those of its own kind that it imports, directly or not.

    Of a module in an archive it is the archive, which nobody looks into.
    """
    file, module = module_file(module), _name_in_files(module)
    if file is None:
        return []
    if not file.is_file():
        return [parent for parent in file.parents if parent.is_file()][:1]
    root = file.parents[module.count(".") + (file.name == "__init__.py")]
    package = module.partition(".")[0]
    installed = str(root) in map(sysconfig.get_path, ("purelib", "platlib", "stdlib"))
    found, waiting = {file}, {*_imports(file, _package(file, module))}
    while waiting:
        name = waiting.pop()
        top = name.partition(".")[0]
        path = root.joinpath(*name.split("."))
        source = next((f for f in (path.with_suffix(".py"), path / "__init__.py") if f.is_file()), None)
        if source is None or source in found or top in PACKAGES or (installed and top != package):
            continue
        found.add(source)
        waiting |= _imports(source, _package(source, name))
    return sorted(found)


def _package(file: Path, module: str) -> str:
    """Return the package from which the relative imports of a module go."""
    return module if file.name == "__init__.py" else module.rpartition(".")[0]


def _name_in_files(module: str) -> str:
    """Return the name by which files are found: for ``__main__`` that of the program's module or file."""
    if module != "__main__":
        return module
    spec = sys.modules[module].__spec__  # None of a file that is run as it is
    file = module_file(module)
    return spec.name if spec is not None else "" if file is None else file.stem


def _read_imports(source: Path, package: str) -> set[str]:
    """Return the modules that a file of a package may import, with the packages around them."""
    try:
        nodes = list(ast.walk(ast.parse(source.read_bytes())))
    except (SyntaxError, ValueError):
        return set()  # building the trial reports the mistake
    names: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            around = package.split(".") if node.level else []
            base = [*around[: len(around) - node.level + 1], *filter(None, [node.module])]
            names |= {".".join([*base, alias.name]) for alias in node.names} | {".".join(base)}
    parts = [name.split(".") for name in names if name]
    return {".".join(p[: i + 1]) for p in parts for i in range(len(p))}


# To parse a file takes milliseconds, and every trial asks for all files of every class of one's own.
_imports = FileCache(lambda source, package: (_read_imports(source, package), [source]), most=1024)


def module_file(module: str) -> Path | None:
    """Return the file of a module; None when there is none, an error that building the trial reports."""
    if module == "__main__":
        file = getattr(sys.modules[module], "__file__", None)  # none of a notebook's cell
        return None if file is None else Path(file)
    try:
        with current_folder_importable():
            spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
    return Path(spec.origin) if spec is not None and spec.origin is not None else None
