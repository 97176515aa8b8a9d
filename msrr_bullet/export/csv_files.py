"""Writes a run's log as CSV files, one for each kind of message, and what their columns mean."""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

from msrr_bullet.export import approach
from msrr_bullet.export.table import Column, Row, Table, columns, text
from msrr_bullet.export.tables import TABLES
from msrr_bullet.log.reader import Log
from msrr_bullet.timeline.log_snapshots import snapshots
from msrr_scenes.errors import MsrrError

#: The table that says what the columns of the others mean.
COLUMNS_NAME = "columns"

_ABOUT_COLUMNS = columns(table="name of the table", column="name of the column", about="what it holds")
_BY_KIND: dict[type, Table] = {table.kind: table for table in TABLES}


class ExportError(MsrrError):
    """Tables that cannot be written."""


def documented() -> Iterator[tuple[str, str, tuple[Column, ...]]]:
    """Yield name, meaning and columns of every table that an export can have."""
    for table in TABLES:
        yield table.name, table.about, table.columns
    yield approach.NAME, approach.ABOUT, approach.COLUMNS


def write_csv(log: Log, folder: Path) -> tuple[Path, ...]:
    """Write the tables of a log that have a row; return their files. The same log gives the same bytes.

    Args:
        log: The log.
        folder: Is made when it is not there; files of the same names are overwritten.

    Raises:
        ExportError: The folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            sheets = _Sheets(folder, stack)
            for record in log.records():
                table = _BY_KIND.get(record.kind)
                if table is not None:
                    for row in table.rows(record):
                        sheets.add(table.name, table.columns, row)
            frames = snapshots(log)
            for row in approach.rows(log.header.scene, frames) if frames else ():
                sheets.add(approach.NAME, approach.COLUMNS, row)
            for name, _, table_columns in documented():
                if name in sheets.names:
                    for column in table_columns:
                        sheets.add(COLUMNS_NAME, _ABOUT_COLUMNS, (name, column.name, column.about))
            return sheets.paths
    except OSError as error:
        raise ExportError(f"{error.filename or folder}: cannot be written ({error.strerror})") from None


class _Sheets:
    """The files of one export; each is opened with its first row."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self._folder, self._stack = folder, stack
        self._files: dict[str, TextIO] = {}

    @property
    def names(self) -> Collection[str]:
        return self._files.keys()

    @property
    def paths(self) -> tuple[Path, ...]:
        return tuple(self._folder / f"{name}.csv" for name in self._files)

    def add(self, name: str, about: Sequence[Column], row: Row) -> None:
        if name not in self._files:
            path = self._folder / f"{name}.csv"
            file = self._stack.enter_context(path.open("w", encoding="utf-8", newline=""))
            self._files[name] = file
            _write(file, [column.name for column in about])
        _write(self._files[name], [text(cell) for cell in row])


def _write(file: TextIO, cells: Sequence[str]) -> None:
    csv.writer(file, lineterminator="\n").writerow(cells)
