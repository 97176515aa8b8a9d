"""CSV files of a run's log, one for each class of messages, and a file that describes their columns."""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

from msrr_bullet.export import approach
from msrr_bullet.export.robot_tables import ROBOT_TABLES
from msrr_bullet.export.sensor_tables import SENSOR_TABLES
from msrr_bullet.export.table import Column, Row, Table, columns, text
from msrr_bullet.log import Log
from msrr_bullet.timeline.log_snapshots import read_snapshots
from msrr_scenes.errors import MsrrError

TABLES: tuple[Table, ...] = (*ROBOT_TABLES, *SENSOR_TABLES)

#: Name of the table that describes the columns of the others.
COLUMNS_NAME = "columns"

_COLUMNS_COLUMNS = columns(table="name of the table", column="name of the column", about="what it holds")


class ExportError(MsrrError):
    """The tables cannot be written."""


def documented_tables() -> Iterator[tuple[str, str, tuple[Column, ...]]]:
    """Yield name, meaning and columns of every table that an export can have."""
    for table in TABLES:
        yield table.name, table.about, table.columns
    yield approach.NAME, approach.ABOUT, approach.COLUMNS


def write_csv(log: Log, folder: Path) -> tuple[Path, ...]:
    """Write the tables of a log that have a row. The same log gives the same bytes.

    Args:
        log: Log of the run.
        folder: Folder for the files, created if needed. Files of the same names are overwritten.

    Returns:
        The files that were written.

    Raises:
        ExportError: The folder cannot be written.
    """
    tables = {table.kind: table for table in TABLES}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            files = _CsvFiles(folder, stack)
            for record in log.records():
                table = tables.get(record.kind)
                if table is not None:
                    for row in table.rows(record, record.message):
                        files.add(table.name, table.columns, row)
            snapshots = read_snapshots(log)
            for row in approach.rows(log.header.scene, snapshots) if snapshots else ():
                files.add(approach.NAME, approach.COLUMNS, row)
            for name, _, table_columns in documented_tables():
                if name in files.names:
                    for column in table_columns:
                        files.add(COLUMNS_NAME, _COLUMNS_COLUMNS, (name, column.name, column.about))
            return files.paths
    except OSError as error:
        raise ExportError(f"{error.filename or folder}: cannot be written ({error.strerror})") from None


class _CsvFiles:
    """Files of one export. Each is opened with its first row."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self._folder, self._stack = folder, stack
        self._files: dict[str, TextIO] = {}

    @property
    def names(self) -> Collection[str]:
        return self._files.keys()

    @property
    def paths(self) -> tuple[Path, ...]:
        return tuple(self._folder / f"{name}.csv" for name in self._files)

    def add(self, name: str, table_columns: Sequence[Column], row: Row) -> None:
        if name not in self._files:
            path = self._folder / f"{name}.csv"
            file = self._stack.enter_context(path.open("w", encoding="utf-8", newline=""))
            self._files[name] = file
            _write_line(file, [column.name for column in table_columns])
        _write_line(self._files[name], [text(cell) for cell in row])


def _write_line(file: TextIO, cells: Sequence[str]) -> None:
    csv.writer(file, lineterminator="\n").writerow(cells)
