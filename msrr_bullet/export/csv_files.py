"""CSV files of a run's log, one for each class of messages, and a file that describes their columns."""

from __future__ import annotations

import csv
import heapq
import math
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TextIO

from msrr_bullet.export.mission_tables import MISSION_TABLES
from msrr_bullet.export.robot_tables import ROBOT_TABLES
from msrr_bullet.export.sensor_tables import SENSOR_TABLES
from msrr_bullet.export.table import EDGES, PHASE, Column, Row, Table, columns, text, time
from msrr_bullet.log import Log
from msrr_bullet.run_folder import make_folder
from msrr_bullet.timeline.log_snapshots import read_snapshots
from msrr_bullet.timeline.series import TrialSeries
from msrr_bullet.timeline.snapshot import Snapshot, step_histories
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.scene import Scene

TABLES: tuple[Table, ...] = (*ROBOT_TABLES, *MISSION_TABLES, *SENSOR_TABLES)

#: Name and columns of the table that compares belief with truth, from which plots are drawn.
APPROACH = "approach"
_ABOUT_APPROACH = (
    "Belief beside truth at each decision: what `msrr plot` draws, derived from the tables above."
)
_APPROACH_COLUMNS = columns(
    time_s="simulated time, or that of the recording",
    unit="name of the docking unit",
    attempt="number of the attempt, from 1",
    **PHASE,
    true_gap_m="true distance of the unit's port from the face of the target's, along the docking axis",
    true_lateral_m="true offset of the unit's port to the left of the docking axis",
    true_yaw_rad="true heading relative to the docking axis",
    believed_gap_m="estimate of true_gap_m",
    believed_lateral_m="estimate of true_lateral_m",
    believed_yaw_rad="estimate of true_yaw_rad",
    commanded_v_mps="commanded forward velocity",
    commanded_w_radps="commanded turn rate",
    true_v_mps="true forward velocity until the next decision, empty in the last row of a step",
    true_w_radps="true turn rate until the next decision, empty in the last row of a step",
    **EDGES,
    seen="1 when both angles were measured in an image",
    clearance_m="true smallest distance between two bodies that are neither docking nor locked together",
    believed_off_path_m="estimated distance of the controlled point from the desired point on the path",
    true_off_path_m="true distance of the controlled point from the desired point on the path",
    wall="1 while a wall beside an obstacle is in force",
)

#: Name and columns of the table that describes the columns of the others.
COLUMNS = "columns"
_COLUMNS_COLUMNS = columns(
    table="name of the table", column="name of the column, empty for the table itself", about="what it holds"
)


class ExportError(MsrrError):
    """The tables cannot be written."""


def documented_tables() -> Iterator[tuple[str, str, tuple[Column, ...]]]:
    """Yield name, meaning and columns of every table that an export can have."""
    for table in TABLES:
        yield table.name, table.about, table.columns
    yield APPROACH, _ABOUT_APPROACH, _APPROACH_COLUMNS


def write_csv(log: Log, folder: str | Path) -> tuple[Path, ...]:
    """Write the tables of a log that have a row, and return the files.

    The same log gives the same bytes. Tables of an earlier export give way once all of these are written,
    also those that this log does not have; no other file does. The folder is created if needed, and files of
    the same names are overwritten.

    Raises:
        RunFolderError: The folder cannot be written.
        ExportError: A file in it cannot be written, or no table has a row.
        LogError: The log is damaged.
    """
    folder = Path(folder)
    tables = {table.kind: table for table in TABLES}
    make_folder(folder)
    try:
        # In the same folder, to be moved within one disk.
        with TemporaryDirectory(prefix=".msrr-", dir=folder) as part_name:
            part = Path(part_name)
            with ExitStack() as stack:
                files = _CsvFiles(part, stack)
                for record in log.records():
                    table = tables.get(record.kind)
                    if table is not None:
                        for row in table.rows(record, record.message):
                            files.add(table.name, table.columns, row)
                if not files.names:
                    raise ExportError(f"{log.path}: no message of which a table has a row; none is written")
                snapshots = read_snapshots(log)
                for row in _approach_rows(log.header.scene, snapshots) if snapshots else ():
                    files.add(APPROACH, _APPROACH_COLUMNS, row)
                for name, about, table_columns in documented_tables():
                    if name in files.names:
                        files.add(COLUMNS, _COLUMNS_COLUMNS, (name, None, about))
                        for column in table_columns:
                            files.add(COLUMNS, _COLUMNS_COLUMNS, (name, column.name, column.about))
            earlier = _earlier_tables(folder)
            written = [folder / path.name for path in files.paths]
            for path in written:
                (part / path.name).replace(path)
        for name in earlier - set(files.names):
            (folder / f"{name}.csv").unlink(missing_ok=True)
        return tuple(written)
    except OSError as error:
        place = error.filename2 or error.filename or folder
        raise ExportError(f"{place}: cannot be written ({error.strerror})") from None


def _earlier_tables(folder: Path) -> set[str]:
    """Return the names of the tables of an earlier export in a folder, by the table that describes them."""
    try:
        with (folder / f"{COLUMNS}.csv").open(encoding="utf-8", newline="") as file:
            listed = {row.get("table") for row in csv.DictReader(file)}
    except (FileNotFoundError, UnicodeDecodeError, csv.Error):
        return set()
    return {name for name, _, _ in documented_tables() if name in listed} | {COLUMNS}


def _approach_rows(scene: Scene, snapshots: Sequence[Snapshot]) -> Iterator[Row]:
    """Yield the rows of all steps in order of time."""
    histories = step_histories(snapshots)
    steps = ([at.of_unit(step.unit) for at, _ in history] for step, history in histories.items())
    for _, row in heapq.merge(*(_step_rows(scene, step) for step in steps), key=lambda pair: pair[0]):
        yield row


def _step_rows(scene: Scene, snapshots: Sequence[Snapshot]) -> Iterator[tuple[int, Row]]:
    """Yield time [ns] and row of every instant of one step."""
    series = TrialSeries.of(scene, snapshots)
    driven = series.driven.copy()
    driven[-1] = math.nan  # behind the last decision nothing was measured; a plot holds the value before
    for i, snapshot in enumerate(snapshots):
        row = (
            time(snapshot.stamp_ns),
            snapshot.first.unit,
            snapshot.first.attempt,
            snapshot.first.phase,
            *series.true_port[i].tolist(),
            *series.believed_port[i].tolist(),
            *series.commanded[i].tolist(),
            *driven[i].tolist(),
            *series.sight[i].tolist(),
            bool(series.seen[i]),
            float(series.clearance[i]),
            float(series.off_path[i]),
            float(series.true_off_path[i]),
            bool(series.avoiding[i]),
        )
        yield snapshot.stamp_ns, row


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
            file = self._stack.enter_context(
                (self._folder / f"{name}.csv").open("w", encoding="utf-8", newline="")
            )
            self._files[name] = file
            _write_line(file, [column.name for column in table_columns])
        _write_line(self._files[name], [text(cell) for cell in row])


def _write_line(file: TextIO, cells: Sequence[str]) -> None:
    csv.writer(file, lineterminator="\n").writerow(cells)
