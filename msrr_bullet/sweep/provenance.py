"""The fingerprint of the code that computes a trial, by which stored results of other code are told apart."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
import sysconfig
from functools import cache, lru_cache
from pathlib import Path

from msrr_bullet.trial.versions import package_versions
from msrr_scenes.registry import choices, current_folder_importable, is_import_path
from msrr_scenes.specs.scene import Scene

_PACKAGES = ("msrr_scenes", "msrr_perception", "msrr_control", "msrr_bullet")


def code_fingerprint(scene: Scene, *, imported: bool = False) -> str:
    """Return a digest of the code that a trial of ``scene`` runs.

    It covers the versions of the packages that can change a bit, every source file of this project, and of
    each implementation that the scene names by import path its file with those that it imports from the same
    folder, or from the same package if it is installed.

    Args:
        scene: The scene.
        imported: Whether the latter files count as they were when this process first asked, just before it
            imported them: a process that lives on runs what it has imported.
    """
    digest = hashlib.blake2b(digest_size=12)
    digest.update(_own_code())
    for module in sorted({c.name.partition(":")[0] for c in choices(scene) if is_import_path(c)}):
        digest.update(module.encode())
        digest.update(_as_imported(module) if imported else _as_it_is(module))
    return digest.hexdigest()


def _as_it_is(module: str) -> bytes:
    return b"".join(file.read_bytes() for file in _files_of(module))


@cache
def _as_imported(module: str) -> bytes:
    return _as_it_is(module)


def _files_of(module: str) -> list[Path]:
    """Return the file of a module and those of its own kind that it imports, directly or not."""
    file = _module_file(module)
    if file is None:
        return []
    root = file.parents[module.count(".") + (file.name == "__init__.py")]
    package = module.partition(".")[0]
    installed = str(root) in (sysconfig.get_path("purelib"), sysconfig.get_path("platlib"))
    found: set[Path] = set()
    waiting = {module}
    while waiting:
        name = waiting.pop()
        top = name.partition(".")[0]
        path = root.joinpath(*name.split("."))
        source = next((f for f in (path.with_suffix(".py"), path / "__init__.py") if f.is_file()), None)
        if source is None or source in found or top in _PACKAGES or (installed and top != package):
            continue
        found.add(source)
        waiting |= _imports(source, name if source.name == "__init__.py" else name.rpartition(".")[0])
    return sorted(found)


def _imports(source: Path, package: str) -> set[str]:
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


@lru_cache(maxsize=1)
def _own_code() -> bytes:
    """Return a digest of the package versions and of every source file of this project."""
    digest = hashlib.blake2b(json.dumps(package_versions(), sort_keys=True).encode())
    for package in _PACKAGES:
        root = _module_file(package)
        if root is None:
            continue
        for file in sorted(root.parent.rglob("*.py")):
            digest.update(str(file.relative_to(root.parent)).encode())
            digest.update(file.read_bytes())
    return digest.digest()


def _module_file(module: str) -> Path | None:
    """Return the file of a module; None when there is none, an error that building the trial reports."""
    try:
        with current_folder_importable():
            spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
    return Path(spec.origin) if spec is not None and spec.origin is not None else None
