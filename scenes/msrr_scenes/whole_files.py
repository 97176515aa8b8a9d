"""Files that are written as a whole or not at all."""

from __future__ import annotations

import os
import shutil
from pathlib import Path


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


def write_whole(file: Path, text: str) -> None:
    """Write a text file in UTF-8; an older one of that name is lost only when the new one is whole.

    A link leads to the file that is written, and a device or a pipe is written as it is.

    Raises:
        OSError: It cannot be written. That of a full disk does not name it.
    """
    file = file.resolve()
    if file.exists() and not file.is_file():
        file.write_text(text, encoding="utf-8")
        return
    part = part_of(file)
    try:
        part.write_text(text, encoding="utf-8")
        put_in_place(part, file)
    finally:
        part.unlink(missing_ok=True)
