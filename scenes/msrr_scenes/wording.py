"""Numbers of things in words, as messages and tables for people have them."""

from __future__ import annotations


def counted(count: int, what: str) -> str:
    """Return a number of things: ``counted(1, "tag")`` is ``1 tag``, ``counted(2, "tag")`` is ``2 tags``.

    Args:
        count: How many.
        what: Name of one of them, whose plural ends in s.
    """
    return f"{count} {what}{'' if count == 1 else 's'}"
