"""Text files that are written as a whole or not at all."""

from __future__ import annotations

import os
import shutil
from pathlib import Path


def write_whole(file: Path, text: str) -> None:
    """Write a file in UTF-8; an older one of that name is lost only when the new one is whole.

    Raises:
        OSError: It cannot be written. That of a full disk does not name it.
    """
    part = file.with_name(f".msrr-{os.getpid()}.part")  # in the same folder, to be moved within one disk
    try:
        part.write_text(text, encoding="utf-8")
        if file.exists():
            file.open("r+").close()  # one that may not be written may not be replaced
            shutil.copymode(file, part)
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)
