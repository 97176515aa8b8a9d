"""Docstrings as Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_ROLE = re.compile(r":\w+:`~?(?:[\w.]*\.)?(\w+)`")
_CODE = re.compile(r"(``.+?``|`.+?`)", re.DOTALL)


def prose(text: str) -> str:
    """Return the text of a docstring as Markdown: names as code, and no character taken for a tag."""
    pieces = _CODE.split(_ROLE.sub(r"`\1`", text))
    return "".join(
        piece.replace("``", "`") if piece.startswith("`") else piece.replace("<", "&lt;") for piece in pieces
    )


def cell(text: str) -> str:
    """Return the text of a docstring for a cell of a table, in one line."""
    line = re.sub(r"\s+", " ", prose(text)).strip()
    # A backslash before the bar of a type would be printed: code needs none.
    return "".join(p if p.startswith("`") else p.replace("|", r"\|") for p in _CODE.split(line))


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; its cells are Markdown in one line each."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
