"""What a table is: a name, documented columns, and the rows that a message of the log gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from msrr_bullet.log.reader import LogRecord
from msrr_scenes.messages import NS_PER_S

Cell = str | int | float | bool | Enum | None
Row = Sequence[Cell]


@dataclass(frozen=True, slots=True)
class Column:
    """A column; the unit of a number ends its name."""

    name: str
    about: str


@dataclass(frozen=True, slots=True)
class Table:
    """A table of one kind of message.

    Attributes:
        name: Its file is ``<name>.csv``.
        about: What a row is.
        columns: In order.
        kind: Class of the message.
        rows: The rows of one message.
    """

    name: str
    about: str
    columns: tuple[Column, ...]
    kind: type
    rows: Callable[[LogRecord], Iterable[Row]]


def columns(**about: str) -> tuple[Column, ...]:
    """Return columns from their names and what they hold."""
    return tuple(Column(name, text) for name, text in about.items())


def time(stamp_ns: int) -> str:
    """Return a time [s], exact to the nanosecond."""
    whole, rest = divmod(stamp_ns, NS_PER_S)
    return f"{whole}.{rest:09d}"


def text(cell: Cell) -> str:
    """Return a cell as text: a number so that it reads back to the same bit, nothing for None and NaN."""
    if cell is None:
        return ""
    if isinstance(cell, Enum):
        return str(cell.value)
    if isinstance(cell, bool | np.bool_):
        return str(int(cell))
    if isinstance(cell, float):
        return "" if math.isnan(cell) else repr(float(cell))
    return str(cell)
