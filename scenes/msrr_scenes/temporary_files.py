"""What is said where temporary files find no room."""

from __future__ import annotations

import errno
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

from msrr_scenes.errors import MsrrError

#: Numbers of the errors of a full disk and of a used-up quota; neither names the file that was written.
_FULL = (errno.ENOSPC, errno.EDQUOT)


class NoRoomError(MsrrError):
    """The folder of temporary files is full, which is no mistake in what was asked for."""


@contextmanager
def room_for_temporary_files() -> Iterator[None]:
    """Name the folder of temporary files where a block, or a function, that writes into it finds it full.

    Raises:
        NoRoomError: It is full; the message says what helps.
    """
    try:
        yield
    except OSError as error:
        if error.errno not in _FULL:
            raise
        raise NoRoomError(
            f"{tempfile.gettempdir()}: no room for temporary files ({error.strerror}); free some, or name"
            " another folder in the environment variable TMPDIR"
        ) from None
