"""The fingerprint of the code that computes a trial, by which stored results of other code are told apart."""

from __future__ import annotations

import hashlib
import json
import sys
from functools import lru_cache
from pathlib import Path

from msrr_bullet.trial.versions import package_versions
from msrr_scenes.errors import SceneError
from msrr_scenes.file_cache import FileCache
from msrr_scenes.own_modules import PACKAGES, digest_of, module_file
from msrr_scenes.registry import choices, is_import_path
from msrr_scenes.specs.scene import Scene


def code_fingerprint(scene: Scene, *, imported: bool = False, own: bytes | None = None) -> str:
    """Return a digest of the code that a trial of ``scene`` runs.

    It covers the versions of the packages that can change a bit, every source file of this project, and of
    each implementation that the scene names by import path its file with those that it imports from the same
    folder, or from the same package if it is installed. If ``imported``, all of these files count as they
    were when this process imported them, or first asked: a process that lives on runs what it has imported,
    and one that it spawns what is there. ``own`` is what :data:`own_code` has returned, for many scenes at
    once; None looks at the files again.
    """
    digest = hashlib.blake2b(digest_size=12)
    digest.update(_as_first_asked() if imported else own or own_code())
    for module in _own_modules(scene):
        digest.update(module.encode())
        digest.update(digest_of(module, imported=imported))
    return digest.hexdigest()


def check_files(scene: Scene) -> None:
    """Refuse an implementation of which there is no file, so that it could not be told from an edited one.

    Raises:
        SceneError: A module that this process has, such as the cells of a notebook, has none.
    """
    for module in _own_modules(scene):
        if module in sys.modules and module_file(module) is None:
            raise SceneError(
                f"a class of {module!r} has no file, as one in a cell of a notebook, so that a store could "
                "not tell its results from those after an edit; write it to a file, or leave out the store"
            )


def _own_modules(scene: Scene) -> list[str]:
    """Return the modules of the implementations that a scene names by import path."""
    return sorted({c.name.partition(":")[0] for c in choices(scene) if is_import_path(c)})


@lru_cache(maxsize=1)
def _as_first_asked() -> bytes:
    return own_code()


def _read_own_code() -> tuple[bytes, list[Path]]:
    """Return a digest of the package versions and of every source file of this project, and these files."""
    digest = hashlib.blake2b(json.dumps(package_versions(), sort_keys=True).encode())
    files: list[Path] = []
    for root in filter(None, map(module_file, PACKAGES)):
        for file in sorted(root.parent.rglob("*.py")):
            digest.update(str(file.relative_to(root.parent)).encode())
            digest.update(file.read_bytes())
            files.append(file)
    return digest.digest(), files


#: Digest of the package versions and of every source file of this project, as they are when it is asked for.
own_code = FileCache(_read_own_code, most=1)
