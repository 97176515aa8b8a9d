"""Results of trials in one SQLite file, so that a killed sweep resumes and nothing runs twice."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from msrr_bullet.trial.result import ResultError, TrialResult
from msrr_scenes.errors import MsrrError
from msrr_scenes.outcome import Outcome

#: Version of the tables and of the results in them; it is increased with every change.
LAYOUT = 4

#: File of a study's folder that holds every trial.
STUDY_STORE = "trials.sqlite"

#: What makes a store of an empty file, at once: no other process sees a part of it.
_CREATION = f"""
BEGIN IMMEDIATE;
PRAGMA user_version = {LAYOUT};
CREATE TABLE IF NOT EXISTS scenes (
    scene_hash TEXT PRIMARY KEY,
    name TEXT NOT NULL,
    scene TEXT NOT NULL  -- JSON
);
CREATE TABLE IF NOT EXISTS trials (
    scene_hash TEXT NOT NULL,
    seed INTEGER NOT NULL,
    code TEXT NOT NULL,  -- msrr_bullet.sweep.provenance.code_fingerprint
    outcome TEXT NOT NULL,
    result TEXT NOT NULL,  -- JSON, msrr_bullet.trial.result.TrialResult
    PRIMARY KEY (scene_hash, seed, code)
);
COMMIT;
"""


#: A row of a table.
_Row = tuple[Any, ...]

#: Errors of SQLite. Where a file is damaged, the text of one may hold bytes that Python cannot decode.
_ERRORS = (sqlite3.Error, UnicodeDecodeError)


#: Size of the header of a file of SQLite [bytes].
_SMALLEST = 100


class StoreError(MsrrError):
    """A store that cannot be read or written."""


def check_store(path: Path) -> None:
    """Refuse what is no store, also that of which :class:`TrialStore` would make one.

    Raises:
        StoreError: There is no such file, it is empty, whatever it is, or no store of this version.
    """
    if not path.is_file():
        raise StoreError(f"{path}: no such store")
    if path.stat().st_size == 0:
        raise StoreError(f"{path}: not a store of trials, an empty file")
    with TrialStore(path):
        pass


def study_store(folder: Path) -> Path:
    """Return the store in which a study keeps its trials, made if there is none.

    Raises:
        StoreError: The file in the folder of the study cannot be used.
    """
    path = folder / STUDY_STORE
    with TrialStore(path, mend="move that file away, or choose another --out"):
        return path


class TrialStore:
    """Results keyed by (scene hash, seed, code). A result is safe on disk when :meth:`put` returns."""

    def __init__(
        self, path: Path, result_type: type[TrialResult] = TrialResult, mend: str = "name another store"
    ) -> None:
        """Open a store; create it if the file does not exist.

        ``mend`` is what messages say is to be done if the file is no store.

        Raises:
            StoreError: The file is not a store, has another layout, or cannot be opened.
        """
        self._path, self._result_type = path, result_type
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.is_file() and 0 < path.stat().st_size < _SMALLEST:
                raise sqlite3.DatabaseError("file is not a database")  # of one byte SQLite makes one
            self._db = sqlite3.connect(path.absolute(), timeout=30.0)  # SQLite has names of its own
            with self._db:
                tables = {name for (name,) in self._db.execute("SELECT name FROM sqlite_master")}
                layout = int(self._db.execute("PRAGMA user_version").fetchone()[0])
                if tables and not {"scenes", "trials"} <= tables:
                    raise StoreError(f"{path}: a database, but no store of trials; {mend}")
                if tables and layout != LAYOUT:
                    raise StoreError(
                        f"{path}: not a store of this version (layout {layout}, now {LAYOUT});"
                        f" delete the file, or {mend}"
                    )
                if not tables:
                    self._db.executescript(_CREATION)
        except (*_ERRORS, OSError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            raise StoreError(f"{path}: cannot be opened as a store of trials ({reason}); {mend}") from None

    def __enter__(self) -> TrialStore:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    def put_scene(self, scene_hash: str, name: str, scene_json: str) -> None:
        """Store the scene that a hash stands for."""
        self._write("INSERT OR IGNORE INTO scenes VALUES (?, ?, ?)", (scene_hash, name, scene_json))

    def put(self, result: TrialResult, code: str) -> None:
        """Store a result."""
        row = (result.scene_hash, result.seed, code, result.outcome.value, result.model_dump_json())
        self._write("INSERT OR REPLACE INTO trials VALUES (?, ?, ?, ?, ?)", row)

    def get(self, scene_hash: str, code: str, seeds: Iterable[int]) -> dict[int, TrialResult]:
        """Return the stored results of these seeds, by seed.

        Raises:
            StoreError: The store cannot be read.
        """
        wanted = set(seeds)
        query = "SELECT seed, result FROM trials WHERE scene_hash = ? AND code = ?"
        rows = self._rows(query, (scene_hash, code))
        return {seed: self._result(seed, text) for seed, text in rows if seed in wanted}

    def outdated(self, scene_hash: str, code: str) -> set[int]:
        """Return the seeds of the stored results of a scene that are of other code."""
        query = "SELECT seed FROM trials WHERE scene_hash = ? AND code <> ?"
        return {seed for (seed,) in self._rows(query, (scene_hash, code))}

    def merge(self, *others: Path) -> list[tuple[int, int]]:
        """Add the scenes and results of other stores, all of them or none.

        A result that ended as ``program_failed`` gives way to one that did not, whichever is here.

        Returns:
            Of each store the number of results that were added, and of those that were here already.

        Raises:
            StoreError: A file is no store, one of its results cannot be read, or one of the same scene, seed,
                code and machine differs. Nothing is added then. One of another processor or C library may
                differ; that which is here is kept.
        """
        for other in others:
            check_store(other)
            # What cannot be read would spoil this store. It is looked for while sweeps may write here.
            with TrialStore(other) as source:
                for seed, text in source._rows("SELECT seed, result FROM trials"):
                    source._result(seed, text)
        try:
            with self._db:  # one transaction
                self._db.execute("BEGIN IMMEDIATE")  # before the first look: a sweep may write here, too
                return [self._add(other) for other in others]
        except _ERRORS as error:
            raise self._unwritten(error) from None

    def _add(self, other: Path) -> tuple[int, int]:
        with TrialStore(other) as source:
            scenes, trials = source._rows("SELECT * FROM scenes"), source._rows("SELECT * FROM trials")
        failed = Outcome.PROGRAM_FAILED.value
        added = []
        for row in trials:
            query = "SELECT outcome, result FROM trials WHERE scene_hash = ? AND seed = ? AND code = ?"
            here = self._rows(query, row[:3])
            if here and here[0][1] == row[4]:
                continue
            if not here or (here[0][0] == failed and row[3] != failed):
                added.append(row)
            elif row[3] != failed and self._same_versions(row[1], here[0][1], row[4]):
                raise StoreError(
                    f"{other}: its result of seed {row[1]} is another one than in {self._path}; run that seed"
                    " with msrr sweep --fresh, and leave out the store whose result is another one"
                )
        self._db.executemany("INSERT OR IGNORE INTO scenes VALUES (?, ?, ?)", scenes)
        self._db.executemany("INSERT OR REPLACE INTO trials VALUES (?, ?, ?, ?, ?)", added)
        return len(added), len(trials) - len(added)

    def _same_versions(self, seed: int, *texts: str) -> bool:
        first, second = (self._result(seed, text).versions for text in texts)
        return first == second

    def _result(self, seed: int, text: str) -> TrialResult:
        """Return a stored result."""
        try:
            result = self._result_type.from_json(text)
        except ResultError as error:
            raise StoreError(
                f"{self._path}: the result of seed {seed} cannot be read: {error}; name another store"
            ) from None
        if result.seed != seed:
            raise StoreError(
                f"{self._path}: the result of seed {seed} says that it is of seed {result.seed}; "
                "name another store"
            )
        return result

    def _unwritten(self, error: Exception) -> StoreError:
        text = f"cannot be written ({error}); make room, end what else uses it, or name another store"
        return StoreError(f"{self._path}: {text}")

    def _rows(self, query: str, values: tuple[object, ...] = ()) -> list[_Row]:
        try:
            return self._db.execute(query, values).fetchall()
        except _ERRORS as error:
            raise StoreError(f"{self._path}: cannot be read ({error}); name another store") from None

    def _write(self, statement: str, row: tuple[object, ...]) -> None:
        try:
            with self._db:
                self._db.execute(statement, row)
        except _ERRORS as error:
            raise self._unwritten(error) from None
