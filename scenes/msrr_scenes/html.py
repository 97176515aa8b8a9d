"""Tables as HTML, by which objects show themselves in notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def html_table(title: str, rows: Iterable[Sequence[object]], head: Sequence[str] = ()) -> str:
    """Return a table below a title, with a line of titles of columns if there are any; texts are escaped."""
    lines = "".join(f"<tr>{''.join(_cell('td', cell) for cell in row)}</tr>" for row in rows)
    line = f"<tr>{''.join(_cell('th', cell) for cell in head)}</tr>" if head else ""
    return f"<div>{escape(title)}</div><table>{line}{lines}</table>"


def _cell(kind: str, content: object) -> str:
    return f'<{kind} style="text-align:left">{escape(str(content))}</{kind}>'
