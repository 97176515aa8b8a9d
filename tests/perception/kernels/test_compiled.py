"""The folder in which compiled code is stored, and the announcement of a compilation."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_perception.kernels import compiled, warm
from msrr_perception.kernels.compiled import KernelCompiler
from msrr_perception.kernels.edges import intersect_edges

FolderOf = Callable[..., Path]
SOURCES = Path(compiled.__file__).parent


@pytest.fixture
def folder_of(monkeypatch: pytest.MonkeyPatch) -> FolderOf:
    def find(sources: Path = SOURCES, **environment: str) -> Path:
        for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME", "TMPDIR"):
            monkeypatch.delenv(name, raising=False)
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr("tempfile.tempdir", environment.get("TMPDIR"))
        return KernelCompiler(sources).folder

    return find


def test_the_folder_of_compiled_code_is_the_users(folder_of: FolderOf, tmp_path: Path) -> None:
    given, cache, home, temporary = (tmp_path / n for n in ("given", "cache", "home", "tmp"))
    blocked = tmp_path / "file"
    blocked.write_text("")
    temporary.mkdir()
    assert folder_of(NUMBA_CACHE_DIR=str(given), HOME=str(home)).parent == given
    assert folder_of(XDG_CACHE_HOME=str(cache), HOME=str(home)).parent == cache / "msrr-bullet"
    assert folder_of(HOME=str(home)).parent == home / ".cache" / "msrr-bullet"
    fallback = folder_of(XDG_CACHE_HOME=str(blocked), TMPDIR=str(temporary))
    assert fallback.parent == temporary / f"msrr-bullet-{os.getuid()}"
    # Nobody else may put code there for us to run.
    assert fallback.stat().st_mode & 0o077 == 0
    fallback.chmod(0o777)
    private = folder_of(XDG_CACHE_HOME=str(blocked), TMPDIR=str(temporary))
    assert private.parent == temporary
    assert private.stat().st_mode & 0o077 == 0


def test_an_edited_kernel_is_compiled_anew(folder_of: FolderOf, tmp_path: Path) -> None:
    copy = tmp_path / "sources"
    copy.mkdir()
    for source in SOURCES.glob("*.py"):
        (copy / source.name).write_bytes(source.read_bytes())
    before = folder_of(copy, NUMBA_CACHE_DIR=str(tmp_path))
    assert folder_of(copy, NUMBA_CACHE_DIR=str(tmp_path)) == before
    with (copy / "edges.py").open("a") as file:
        file.write("# edited\n")
    assert folder_of(copy, NUMBA_CACHE_DIR=str(tmp_path)) != before


def test_a_copy_elsewhere_is_known_not_to_be_compiled(tmp_path: Path) -> None:
    """numba stores machine code by the place of its source."""
    warm.warm()
    copy = tmp_path / "sources"
    shutil.copytree(SOURCES, copy)
    assert KernelCompiler(SOURCES).is_compiled(intersect_edges)
    assert not KernelCompiler(copy).is_compiled(intersect_edges)


def test_ready_code_is_not_announced() -> None:
    warm.warm()
    announced: list[str] = []
    warm.warm(announced.append)
    assert announced == []
