"""The folder in which compiled code is stored, and the announcement of a compilation."""

from __future__ import annotations

import ast
import builtins
import importlib
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from numba.core.compiler_lock import global_compiler_lock

from msrr_perception.kernels import compiled, warm
from msrr_perception.kernels.compiled import KernelCompiler
from msrr_perception.kernels.edges import intersect_edges

FolderOf = Callable[..., Path]
SOURCES = Path(compiled.__file__).parent

#: What kernels import from elsewhere: names of types, and how to compile.
NO_NUMBERS = (
    "msrr_scenes.arrays",
    "msrr_scenes.messages",
    "msrr_scenes.geometry.lens",
    "msrr_perception.kernels.compiled",
)


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


def test_a_copy_elsewhere_is_known_to_be_compiled(tmp_path: Path) -> None:
    warm.warm()
    copy = tmp_path / "sources"
    shutil.copytree(SOURCES, copy)
    assert KernelCompiler(copy).is_compiled(intersect_edges)
    with (copy / "linear_algebra.py").open("a") as file:
        file.write("# edited\n")
    assert not KernelCompiler(copy).is_compiled(intersect_edges)


def test_another_user_has_another_folder(
    folder_of: FolderOf, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = folder_of(NUMBA_CACHE_DIR=str(tmp_path), TMPDIR=str(tmp_path))
    user = os.getuid()
    monkeypatch.setattr("os.getuid", lambda: user + 1)
    other = folder_of(NUMBA_CACHE_DIR=str(tmp_path), TMPDIR=str(tmp_path))
    assert mine.parent == tmp_path
    assert other != mine


TINY = """
from pathlib import Path

from msrr_perception.kernels.compiled import KernelCompiler

@KernelCompiler(Path(__file__).parent).kernel
def twice(number):
    return 2 * number

twice(21)
print(sum(twice.stats.cache_hits.values()), sum(twice.stats.cache_misses.values()))
"""


@pytest.mark.nightly
def test_machine_code_is_shared_by_what_was_compiled(tmp_path: Path) -> None:
    """Where a package lies and when it was written does not count; its contents and the processor do."""
    packages = [tmp_path / name / "kernels" for name in ("one", "another")]
    for package in packages:
        package.mkdir(parents=True)
        (package / "tiny.py").write_text(TINY)

    def hits_and_misses(package: Path, **environment: str) -> str:
        given = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), **environment}
        program = [sys.executable, str(package / "tiny.py")]
        return subprocess.run(program, env=given, check=True, capture_output=True, text=True).stdout.strip()

    one, another = packages
    assert hits_and_misses(one) == "0 1"
    os.utime(one / "tiny.py", (1e9, 1e9))
    assert hits_and_misses(one) == "1 0"
    assert hits_and_misses(another) == "1 0"
    assert hits_and_misses(another, NUMBA_CPU_NAME="generic") == "0 1"
    assert hits_and_misses(another) == "1 0"
    (another / "other.py").write_text("HALF = 0.5")
    assert hits_and_misses(another) == "0 1"


def test_no_kernel_follows_from_code_outside_its_package() -> None:
    """The machine code is found by the contents of the package alone."""
    for package in (
        "msrr_perception.kernels",
        "msrr_bullet.render.raster.kernels",
        "msrr_bullet.sensors.kernels",
    ):
        folder = Path(importlib.import_module(package).__path__[0])
        inside = (f"{package}.", *NO_NUMBERS)
        for file in folder.glob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("msrr_"):
                    assert node.module.startswith(inside), f"{file}: {node.module}"


def test_ready_code_is_not_announced() -> None:
    warm.warm()
    announced: list[str] = []
    warm.warm(announced.append)
    assert announced == []


def test_a_debugger_can_step_through_the_kernels() -> None:
    """As plain Python they may do nothing that numba alone can, such as to take a field for an attribute."""
    program = "from msrr_perception.kernels.warm import warm; warm()"
    given = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", program], env=given, check=True)


def test_kernels_that_are_first_called_in_two_threads_do_not_wait_for_each_other() -> None:
    """One thread compiles, and asks for what its kernel calls; the other one waits for it to be done."""
    begun, asked = threading.Event(), threading.Event()

    def compile_it(function: Callable[..., object]) -> Callable[..., object]:
        begun.set()
        with global_compiler_lock:  # as numba does
            return function

    def call() -> None:
        compiled._Lazy(lambda: None, compile_it)()

    def compile_kernel() -> None:
        with global_compiler_lock:
            threading.Thread(target=call, daemon=True).start()
            begun.wait(0.2)
            assert compiled._Lazy(len, lambda function: function).__self__ is builtins
            asked.set()

    threading.Thread(target=compile_kernel, daemon=True).start()
    assert asked.wait(10.0)
