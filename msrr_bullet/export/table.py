"""Tables of an export: documented columns, and the rows that a message of the log gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from msrr_bullet.log import LogRecord, topics
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, Exposure, ExposureCounts, Phase

#: What is written for control characters, of which lines and tabs are none.
_ESCAPES = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\n\t"}

Cell = str | int | float | bool | Enum | None
Row = Sequence[Cell]


def one_of(kind: type[Enum]) -> str:
    """Return the values that a cell of this kind can have, in words."""
    *others, last = (str(member.value) for member in kind)
    return f"{', '.join(others)} or {last}"


#: Names and meanings of columns that several tables have; :func:`pose`, :func:`sigma`, ... give their cells.
TIME = {"time_s": "time, simulated or of the recording, at which the message was sent or arrived"}
UNIT = {**TIME, "unit": "name of the unit, or base_station"}
STAMP = {"stamp_s": "time to which the values refer"}
PHASE = {"phase": f"phase of the docking step: {one_of(Phase)}"}
EDGES = {
    f"{side}_rad": f"angle from the camera's axis to the {side} edge of the target, positive to the left"
    for side in ("left", "right")
}
FRAME = {
    "camera": "name of the camera",
    "frame": "number of the frame",
    "exposed_s": "time of exposure by the clock of the camera, which is ahead by its clock_ms in as_built",
}
POSE = {"x_m": "position", "y_m": "position", "yaw_rad": "heading, counter-clockwise positive"}
SIGMA = {
    "sigma_x_m": "standard deviation of x",
    "sigma_y_m": "standard deviation of y",
    "sigma_yaw_rad": "standard deviation of the heading",
}


def exposures(prefix: str = "", of: str = "exposures since the filter was reset") -> dict[str, str]:
    """Return names and meanings of columns that tell what became of exposures."""
    return {
        f"{prefix}used": f"number of {of} that agreed with the filter and corrected it",
        f"{prefix}without_wheels": f"number of {of} that agreed only if the wheels were doubted",
        f"{prefix}rejected": f"number of {of} that did not agree with the filter",
    }


@dataclass(frozen=True, slots=True)
class Column:
    """Column of a table. The name of a number ends with its unit."""

    name: str
    about: str


@dataclass(frozen=True, slots=True)
class Table:
    """Table of one class of messages, the file ``<name>.csv``.

    ``about`` is the meaning of a row, and ``rows`` returns those of one message.
    """

    name: str
    about: str
    kind: type
    columns: tuple[Column, ...]
    rows: Callable[[LogRecord, Any], Iterable[Row]]


def columns(**about: str) -> tuple[Column, ...]:
    """Return columns from names and meanings."""
    return tuple(Column(name, meaning) for name, meaning in about.items())


def time(stamp_ns: int) -> str:
    """Return a time [s] as text, exact to the nanosecond."""
    whole, rest = divmod(abs(stamp_ns), NS_PER_S)
    return f"{'-' if stamp_ns < 0 else ''}{whole}.{rest:09d}"


def unit(record: LogRecord) -> Row:
    """Return the cells of :data:`UNIT`."""
    return time(record.stamp_ns), topics.unit_of(record.topic)


def frame(exposure: Exposure) -> Row:
    """Return the cells of :data:`FRAME`."""
    return exposure.camera, exposure.frame, time(exposure.stamp_ns)


def pose(X: SE2) -> Row:
    """Return the cells of :data:`POSE`."""
    return X.x, X.y, X.yaw


def sigma(covariance: Array) -> Row:
    """Return the cells of :data:`SIGMA`; NaN for the negative variances of a diverged filter."""
    return tuple(math.sqrt(v) if v >= 0.0 else math.nan for v in map(float, covariance.diagonal()))


def exposure_cells(counts: ExposureCounts | None) -> Row:
    """Return the cells of :func:`exposures`."""
    return (None,) * 3 if counts is None else (counts.used, counts.without_wheels, counts.rejected)


def text(cell: Cell) -> str:
    r"""Return a cell as text. Numbers read back to the same bit; None and NaN are empty.

    Control characters, which programs that read CSV refuse, and terminals obey, are written as ``\x1b``.
    """
    if cell is None:
        return ""
    if isinstance(cell, Enum):
        return str(cell.value)
    if isinstance(cell, bool | np.bool_):
        return str(int(cell))
    if isinstance(cell, float):
        return "" if math.isnan(cell) else repr(float(cell))
    return str(cell).translate(_ESCAPES)
