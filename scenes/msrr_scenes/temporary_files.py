"""Messages for disks that have no room for temporary files or for machine code."""

from __future__ import annotations

import errno
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from msrr_scenes.errors import MsrrError

#: Numbers of the errors of a full disk, a used-up quota and a limit on the size of files; none of these names
#: the file that was written.
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class NoRoomError(MsrrError):
    """A folder in which the program works is full, which is no mistake in what was asked for."""


@contextmanager
def room_for(what: str, variable: str, folder: Path | None = None) -> Iterator[None]:
    """Name a folder where a block, or a function, that writes into it finds it full.

    ``what`` is written, in words, and ``variable`` is the environment variable that names another folder. The
    folder is that of temporary files where none is given.

    Raises:
        NoRoomError: It is full; the message says what helps.
    """
    try:
        yield
    except OSError as error:
        if error.errno not in _FULL:
            raise
        raise NoRoomError(
            f"{folder or tempfile.gettempdir()}: no room for {what} ({error.strerror}); free some, or name"
            f" another folder in the environment variable {variable}"
        ) from None


#: For what is written among temporary files.
room_for_temporary_files = partial(room_for, "temporary files", "TMPDIR")
