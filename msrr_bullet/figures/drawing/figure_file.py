"""Files of figures: each is written as a whole or not at all."""

from __future__ import annotations

from pathlib import Path

from msrr_scenes.errors import MsrrError
from msrr_scenes.whole_files import write_whole


def write_figure(path: Path, content: bytes) -> Path:
    """Write the file of a figure and return its path; an older one is lost only when the new one is whole.

    A figure is made in memory, and not in its file, because OpenCV does not say why it cannot write one, and
    because matplotlib writes a file piece by piece.

    Raises:
        MsrrError: The file cannot be written.
    """
    try:
        write_whole(path, content)
    except OSError as error:
        raise MsrrError(f"{path}: cannot be written ({error.strerror})") from None
    return path
