"""Files that are written as a whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from msrr_scenes.errors import MsrrError


def part_of(file: Path, ending: str = ".part") -> Path:
    """Return the path of a part of a file: in the same folder, to be moved within one disk."""
    return file.with_name(f".msrr-{os.getpid()}{ending}")


def put_in_place(part: Path, file: Path) -> None:
    """Move a part that is whole to its file, which keeps its permissions.

    Raises:
        OSError: An older file may not be written, or the part cannot be moved.
    """
    if file.exists():
        file.open("r+").close()  # one that may not be written may not be replaced
        shutil.copymode(file, part)
    part.replace(file)


@contextmanager
def whole_file(file: Path, ending: str = ".part") -> Iterator[Path]:
    """Give the path to write to: that of a part, which becomes the file when the block ends without an error.

    After an error or an interrupt an older file of that name is as before. A link leads to the file that is
    written, and a device or a pipe is written as it is. ``ending`` is that of the name of the part, where
    what writes it asks for one.

    Raises:
        OSError: The part cannot be put in place.
    """
    file = file.resolve()
    if file.exists() and not file.is_file():
        yield file
        return
    part = part_of(file, ending)
    try:
        yield part
        put_in_place(part, file)
    finally:
        with suppress(OSError):  # the error before it says more
            part.unlink(missing_ok=True)


def write_whole(file: Path, content: str | bytes) -> None:
    """Write a file as :func:`whole_file` does: bytes, or a text in UTF-8.

    Raises:
        OSError: It cannot be written. That of a full disk does not name it.
    """
    with whole_file(file) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def write_named(file: Path, content: str | bytes) -> None:
    """Write a file as :func:`write_whole` does, with an error that always names it.

    Raises:
        MsrrError: It cannot be written.
    """
    try:
        write_whole(file, content)
    except OSError as error:
        raise MsrrError(f"{file}: cannot be written ({error.strerror})") from None
