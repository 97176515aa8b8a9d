"""What was read from files is read anew when one of them was written, and not otherwise."""

from __future__ import annotations

import itertools
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_scenes import file_cache
from msrr_scenes.file_cache import FileCache

Write = Callable[[Path], object]


def _until_it_is_old() -> None:
    """Wait until what was written is not taken for written while it is read."""
    time.sleep(2e-9 * file_cache._CLOCK_LAG_NS)


def _by_a_link(file: Path) -> None:
    other = file.with_name("other")
    other.write_text("newer")
    file.unlink()
    file.symlink_to(other)


def _as_old_and_as_long(file: Path) -> None:
    """As a file out of an archive may be: with the time of the older one."""
    other, before = file.with_name("other"), file.stat()
    other.write_text("newer")
    os.utime(other, ns=(before.st_atime_ns, before.st_mtime_ns))
    shutil.copy2(other, file)


@pytest.mark.parametrize(
    "write",
    [lambda file: file.write_text("newer"), _by_a_link, _as_old_and_as_long],
    ids=["written", "led elsewhere", "copied with its time"],
)
def test_a_file_that_is_another_one_is_read_anew(write: Write, tmp_path: Path) -> None:
    file, reads = tmp_path / "file", []

    def read(path: Path) -> tuple[str, list[Path]]:
        reads.append(path)
        return path.read_text(), [path]

    cache = FileCache(read, most=2)
    file.write_text("older")
    _until_it_is_old()
    assert [cache(file), cache(file)] == ["older", "older"]
    assert len(reads) == 1
    write(file)
    _until_it_is_old()
    assert [cache(file), cache(file)] == ["newer", "newer"]
    assert len(reads) == 2


def test_a_file_that_is_written_while_it_is_read_is_read_again(tmp_path: Path) -> None:
    """A file that somebody saves between its reading and the look at its state is not kept as it was."""
    file, reads = tmp_path / "file", []

    def read_and_save() -> tuple[str, list[Path]]:
        text = file.read_text()
        reads.append(text)
        if text == "older":
            file.write_text("newer")
        return text, [file]

    file.write_text("older")
    _until_it_is_old()
    cache = FileCache(read_and_save, most=1)
    assert [cache(), cache()] == ["newer", "newer"]
    assert reads == ["older", "newer"]


def test_a_file_that_is_written_all_the_time_is_read_all_the_same(tmp_path: Path) -> None:
    file, numbers = tmp_path / "file", itertools.count()

    def read() -> tuple[str, list[Path]]:
        file.write_text("x" * next(numbers))
        return file.read_text(), [file]

    cache = FileCache(read, most=1)
    assert [len(cache()), len(cache())] == [file_cache._MOST_READS - 1, 2 * file_cache._MOST_READS - 1]


def test_a_file_that_was_not_there_counts_when_it_is(tmp_path: Path) -> None:
    late = tmp_path / "late"
    cache = FileCache(lambda: (late.exists(), [late]), most=1)
    assert cache() is False
    late.touch()
    assert cache() is True
    late.unlink()
    assert cache() is False


def test_the_values_asked_for_last_are_kept(tmp_path: Path) -> None:
    reads: list[int] = []
    cache = FileCache(lambda k: (reads.append(k) or k, []), most=2)
    for k in (1, 2, 1, 3, 1, 2):
        assert cache(k) == k
    assert reads == [1, 2, 3, 2]


def test_an_error_is_not_kept(tmp_path: Path) -> None:
    file = tmp_path / "file"
    cache = FileCache(lambda path: (path.read_text(), [path]), most=1)
    with pytest.raises(FileNotFoundError):
        cache(file)
    file.write_text("there")
    assert cache(file) == "there"
