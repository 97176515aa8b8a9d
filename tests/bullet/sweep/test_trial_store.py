"""Stores of results: files that are none, full disks, and results by seed."""

import sqlite3
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from threading import Barrier
from typing import Any

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.reproduce.run import reproduce
from msrr_bullet.run import run_trial
from msrr_bullet.sweep.summary import SweepSummary
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.sweep.trial_store import StoreError, TrialStore, check_store
from msrr_bullet.tolerance.study import run_study
from msrr_scenes.loading.load import load_scene
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import inline
from tests.bullet.sweep.conftest import made_up


def test_results_are_found_by_scene_code_and_seed(scene: Scene, tmp_path: Path) -> None:
    results = {seed: made_up(scene, seed) for seed in range(3)}
    with TrialStore(tmp_path / "deep" / "trials.sqlite") as store:
        for result in results.values():
            store.put(result, "code")
    key = results[0].scene_hash
    with TrialStore(tmp_path / "deep" / "trials.sqlite") as store:
        assert store.get(key, "code", range(1, 9)) == {1: results[1], 2: results[2]}
        assert store.get(key, "other", range(3)) == {}
        assert store.get("other", "code", range(3)) == {}


def test_a_name_that_sqlite_gives_a_meaning_is_a_file_as_any_other(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = made_up(scene, 0)
    with TrialStore(Path(":memory:")) as store:
        store.put(result, "code")
    with TrialStore(Path(":memory:")) as store:
        assert store.get(result.scene_hash, "code", [0]) == {0: result}


def test_a_store_that_may_only_be_read_is_read(
    scene: Scene, made_up_sweep: Callable[..., SweepSummary], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = made_up(scene, 0)
    with TrialStore(tmp_path / "trials.sqlite") as store:
        store.put(result, "code")
    made_up_sweep(range(3), store=tmp_path / "trials.sqlite")
    connect = sqlite3.connect

    def read_only(path: Path, timeout: float) -> sqlite3.Connection:
        return connect(f"file:{path}?mode=ro", timeout=timeout, uri=True)

    monkeypatch.setattr(sqlite3, "connect", read_only)
    with TrialStore(tmp_path / "trials.sqlite") as store:
        assert store.get(result.scene_hash, "code", [0]) == {0: result}
        with pytest.raises(StoreError, match="readonly"):
            store.put(result, "other")
    assert made_up_sweep(range(3), store=tmp_path / "trials.sqlite").reused == 3
    with pytest.raises(StoreError, match="readonly"):
        made_up_sweep(range(4), store=tmp_path / "trials.sqlite")


def test_sweeps_that_begin_at_the_same_time_share_a_new_store(tmp_path: Path) -> None:
    """One took the store that another one was creating for that of another version, to be deleted."""
    together = Barrier(3)

    def create(_: int) -> None:
        for k in range(60):
            together.wait(20.0)
            TrialStore(tmp_path / f"{k}.sqlite").__exit__(None, None, None)

    with ThreadPoolExecutor(3) as threads:
        assert list(threads.map(create, range(3))) == [None] * 3


def test_a_result_of_another_processor_contradicts_none(scene: Scene, tmp_path: Path) -> None:
    """It rounds otherwise. What is in the store already is kept."""
    here = made_up(scene, 0)
    versions = {**here.versions, "processor": "z80"}
    there = here.model_copy(update={"duration_s": here.duration_s + 1e-9, "versions": versions})
    with TrialStore(tmp_path / "there.sqlite") as store:
        store.put(there, "code")
    with TrialStore(tmp_path / "here.sqlite") as store:
        store.put(here, "code")
        assert store.merge(tmp_path / "there.sqlite") == [(0, 1)]
        assert store.get(here.scene_hash, "code", [0]) == {0: here}


@pytest.mark.parametrize("into_the_failed", [True, False])
def test_a_failed_program_gives_way_to_a_result(scene: Scene, tmp_path: Path, into_the_failed: bool) -> None:
    """A sweep runs such a trial again; until then it barred the merge of its store for good."""
    good = made_up(scene, 0)
    failed = good.model_copy(update={"outcome": Outcome.PROGRAM_FAILED, "reason": "division by zero"})
    paths = [tmp_path / "good.sqlite", tmp_path / "failed.sqlite"]
    for path, result in zip(paths, (good, failed), strict=True):
        with TrialStore(path) as store:
            store.put(result, "code")
    source, target = paths if into_the_failed else paths[::-1]
    with TrialStore(target) as store:
        assert store.merge(source) == [(1, 0) if into_the_failed else (0, 1)]
        assert store.get(good.scene_hash, "code", [0]) == {0: good}


def test_nothing_is_stored_between_the_look_of_a_merge_and_its_writing(scene: Scene, tmp_path: Path) -> None:
    """A failed result of another store replaced the good one that a sweep had stored meanwhile."""
    target, refused = tmp_path / "target.sqlite", []

    class Watched(TrialStore):
        def _add(self, other: Path) -> tuple[int, int]:
            with closing(sqlite3.connect(target, timeout=0.0)) as sweep:
                with pytest.raises(sqlite3.OperationalError, match="locked"):
                    sweep.execute("DELETE FROM trials")
                refused.append(sweep)
            return super()._add(other)

    with TrialStore(tmp_path / "source.sqlite") as source:
        source.put(made_up(scene, 0), "code")
    with Watched(target) as store:
        assert store.merge(tmp_path / "source.sqlite") == [(1, 0)]
    assert len(refused) == 1


def test_stores_are_merged_and_a_contradiction_changes_nothing(
    scene: Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, parts = tmp_path / "whole.sqlite", [tmp_path / "0.sqlite", tmp_path / "1.sqlite"]
    for part, seeds in zip(parts, (range(4), range(3, 6)), strict=True):
        run_sweep(scene, seeds, store=part, executor=inline, trial=made_up)
    assert run(["merge", *map(str, parts), "--into", str(whole)]) == 0
    told = capsys.readouterr().out
    assert "0.sqlite: 4 results added, 0 were there already" in told
    assert "1.sqlite: 2 results added, 1 were there already" in told
    merged = run_sweep(scene, range(6), store=whole, executor=inline, trial=made_up)
    assert (merged.reused, merged.trials) == (6, 6)

    def rows() -> list[tuple[Any, ...]]:
        with sqlite3.connect(whole) as db:
            return db.execute("SELECT * FROM trials ORDER BY seed").fetchall()

    before = rows()
    with sqlite3.connect(parts[0]) as db:
        db.execute("UPDATE trials SET result = replace(result, 'made up', 'made') WHERE seed = 3")
        renumbered = """seed = 9, result = replace(result, '"seed":0', '"seed":9')"""
        db.execute(f"UPDATE trials SET {renumbered} WHERE seed = 0")
    assert run(["merge", str(parts[0]), "--into", str(whole)]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "its result of seed 3 is another one" in told
    assert "run that seed with msrr sweep --fresh, and leave out the store" in told
    more = tmp_path / "2.sqlite"
    run_sweep(scene, range(6, 8), store=more, executor=inline, trial=made_up)
    assert run(["merge", str(more), str(parts[0]), "--into", str(whole)]) == 2
    assert "added" not in capsys.readouterr().out
    assert run(["merge", str(tmp_path / "none.sqlite"), "--into", str(whole)]) == 2
    assert "none.sqlite: no such store" in capsys.readouterr().err
    (tmp_path / "notes.txt").touch()
    assert run(["merge", str(tmp_path / "notes.txt"), "--into", str(whole)]) == 2
    assert "notes.txt: not a store of trials" in capsys.readouterr().err
    assert (tmp_path / "notes.txt").read_bytes() == b"", "what is read is left as it is"
    (tmp_path / "notes.txt").write_text("no store")
    for name in ("none.sqlite", "notes.txt"):
        assert run(["merge", str(tmp_path / name), "--into", str(tmp_path / "new.sqlite")]) == 2
        assert not (tmp_path / "new.sqlite").exists()
    assert rows() == before


def test_a_file_that_is_no_store(scene: Scene, tmp_path: Path) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("these are notes, long enough to be no database header at all\n" * 20)
    with pytest.raises(StoreError, match=r"notes\.txt"):
        run_sweep(scene, range(1), store=text, executor=inline, trial=made_up)
    assert "these are notes" in text.read_text()
    short = tmp_path / "answer.txt"
    short.write_text("7")  # SQLite takes it for empty, and writes over it
    with pytest.raises(StoreError, match=r"answer\.txt: .*\(file is not a database\); name another"):
        run_sweep(scene, range(1), store=short, executor=inline, trial=made_up)
    with pytest.raises(StoreError, match=r"answer\.txt: .*\(file is not a database\)"):
        check_store(short)
    assert short.read_text() == "7"
    alien = tmp_path / "alien.sqlite"
    with sqlite3.connect(alien) as db:
        db.execute("CREATE TABLE recipes (name TEXT)")
    with pytest.raises(StoreError, match=r"alien\.sqlite: a database, but no store of trials; name another"):
        run_sweep(scene, range(1), store=alien, executor=inline, trial=made_up)
    with pytest.raises(StoreError):
        run_sweep(scene, range(1), store=tmp_path, executor=inline, trial=made_up)


def test_a_store_of_an_earlier_version_is_refused_and_left_as_it_is(scene: Scene, tmp_path: Path) -> None:
    """Layout 1 held results without steps."""
    store = tmp_path / "trials.sqlite"
    run_sweep(scene, range(1), store=store, executor=inline, trial=made_up)
    with sqlite3.connect(store) as db:
        db.execute("PRAGMA user_version = 1")
    with pytest.raises(StoreError, match=r"layout 1.* delete the file, or name another store"):
        run_sweep(scene, range(1), store=store, executor=inline, trial=made_up)
    with sqlite3.connect(store) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (1,)


def test_a_result_that_cannot_be_read_is_one_error(scene: Scene, tmp_path: Path) -> None:
    result = made_up(scene, 0)
    with TrialStore(tmp_path / "trials.sqlite") as store:
        store.put(result, "code")
        with sqlite3.connect(tmp_path / "trials.sqlite") as db:
            db.execute("UPDATE trials SET result = '{}'")
        with pytest.raises(StoreError, match=r"seed 0 cannot be read: not a trial result of this version"):
            store.get(result.scene_hash, "code", [0])
        with sqlite3.connect(tmp_path / "trials.sqlite") as db:
            db.execute("UPDATE trials SET result = ?", [made_up(scene, 7).to_json()])
        with pytest.raises(StoreError, match="seed 0 says that it is of seed 7; name another store"):
            store.get(result.scene_hash, "code", [0])
        with sqlite3.connect(tmp_path / "trials.sqlite") as db:
            db.execute("UPDATE trials SET result = '{}'")
    with TrialStore(tmp_path / "good.sqlite") as store:
        with pytest.raises(StoreError, match=r"trials\.sqlite: the result of seed 0 cannot be read"):
            store.merge(tmp_path / "trials.sqlite")
        assert store.get(result.scene_hash, "code", [0]) == {}, "it would spoil every sweep with this store"


def test_seeds_are_those_of_the_command_line(scene: Scene, tmp_path: Path) -> None:
    store = str(tmp_path / "trials.sqlite")
    for seed in (-1, 2**63):
        with pytest.raises(ValueError, match=rf"a seed is a number from 0 to {2**63 - 1}, found {seed}"):
            run_sweep(scene, [0, seed], store=store, executor=inline, trial=made_up)
        with pytest.raises(ValueError, match=f"found {seed}"):
            run_trial(scene, seed)
    with pytest.raises(TypeError, match="a seed is an integer, found True"):
        run_sweep(scene, [True], store=store, executor=inline, trial=made_up)
    assert run_sweep(scene, [0, 2**63 - 1], store=store, executor=inline, trial=made_up).reused == 0


def test_a_store_with_a_damaged_layout_is_one_error(tmp_path: Path) -> None:
    """SQLite's own message then holds what is no text."""
    path = tmp_path / "trials.sqlite"
    with TrialStore(path):
        pass
    path.write_bytes(path.read_bytes().replace(b"CREATE TABLE trials", b"CREATE \xff\xfe\xfd\xfcE trials"))
    with pytest.raises(StoreError, match=r"trials\.sqlite: cannot be opened as a store of trials"):
        TrialStore(path)


def test_a_place_that_cannot_hold_a_store_is_named_with_the_mend(tmp_path: Path) -> None:
    """Below a file, as in a folder that is read-only; the message had the number of the system's error."""
    (tmp_path / "notes.txt").write_text("")
    for place, reason in (("notes.txt/trials.sqlite", "File exists"), (".", "unable to open database file")):
        with pytest.raises(StoreError) as caught:
            TrialStore(tmp_path / place)
        said = f"{tmp_path / place}: cannot be opened as a store of trials ({reason}); name another store"
        assert str(caught.value) == said


def test_the_store_of_a_study_that_is_something_else_is_named_with_the_option(tmp_path: Path) -> None:
    """Before anything is computed. The message told to name another store, which no option does."""
    file = tmp_path / "trials.sqlite"
    file.write_bytes(b"notes of the last meeting, not a database" * 30)
    for study in (
        lambda: run_study(load_scene("close_range"), tmp_path, seeds=[0, 1], grade_seeds=[0]),
        lambda: reproduce(tmp_path, unicycle=range(1), bullet=range(1)),
    ):
        with pytest.raises(StoreError) as caught:
            study()
        reason = "cannot be opened as a store of trials (file is not a database)"
        assert str(caught.value) == f"{file}: {reason}; move that file away, or choose another --out"


def test_a_store_that_another_program_holds_is_named_with_the_mend(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda path, timeout: connect(path, timeout=0.01))
    path = tmp_path / "trials.sqlite"
    with TrialStore(path) as store, closing(connect(path)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(
            StoreError, match=r"cannot be written \(database is locked\); make room, end what"
        ):
            store.put(made_up(scene, 0), "code")


def test_a_full_disk_is_one_error(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = tmp_path / "trials.sqlite"
    run_sweep(scene, range(1), store=store, executor=inline, trial=made_up)
    with sqlite3.connect(store) as db:
        pages = db.execute("PRAGMA page_count").fetchone()[0]
    real = sqlite3.connect

    def small(*args: Any, **kwargs: Any) -> sqlite3.Connection:
        db = real(*args, **kwargs)
        db.execute(f"PRAGMA max_page_count = {pages}")
        return db

    monkeypatch.setattr(sqlite3, "connect", small)
    with pytest.raises(StoreError, match="full"):
        run_sweep(scene, range(60), store=store, executor=inline, trial=made_up)
