"""Numbers of things in words, as messages and tables for people have them."""

from __future__ import annotations


def counted(count: int, what: str) -> str:
    """Return a number of things whose plural ends in s, such as ``1 tag`` and ``2 tags``."""
    return f"{count} {what}{'' if count == 1 else 's'}"
