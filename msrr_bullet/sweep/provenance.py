"""The fingerprint of the code that computes a trial, by which stored results of other code are told apart."""

from __future__ import annotations

import hashlib
import importlib.util
import json
from functools import lru_cache
from pathlib import Path

from msrr_bullet.trial.versions import package_versions
from msrr_scenes.registry import choices, current_folder_importable, is_import_path
from msrr_scenes.specs.scene import Scene

_PACKAGES = ("msrr_scenes", "msrr_perception", "msrr_control", "msrr_bullet")


def code_fingerprint(scene: Scene) -> str:
    """Return a digest of the code that a trial of ``scene`` runs.

    It covers the versions of the packages that can change a bit, every source file of this project, and the
    file of each implementation that the scene names by import path (not what that file imports in turn).
    """
    digest = hashlib.blake2b(digest_size=12)
    digest.update(_own_code())
    for module in sorted({c.name.partition(":")[0] for c in choices(scene) if is_import_path(c)}):
        file = _module_file(module)
        digest.update(module.encode())
        digest.update(file.read_bytes() if file is not None else b"")
    return digest.hexdigest()


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
