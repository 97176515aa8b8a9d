"""Options that several commands share: overrides, seeds, and the file of numbers."""

import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from msrr_bullet.cli.options import (
    MAX_SEEDS,
    check_writable,
    folder_of,
    parse_overrides,
    parse_seed_range,
    parse_seeds,
    run_or_last,
    write_output,
)
from msrr_scenes.errors import MsrrError, SceneError

Room = Callable[[int], AbstractContextManager[None]]


def test_overrides_and_seeds() -> None:
    assert parse_overrides(["a.b=1", "c=x=y", "d="]) == {"a.b": "1", "c": "x=y", "d": ""}
    assert parse_overrides(None) == {}
    assert parse_seeds("3:6") == range(3, 6)
    assert parse_seeds("9,2,4") == (9, 2, 4)


@pytest.mark.parametrize("pairs", [["a"], ["=1"], ["a=1", "a=2"]])
def test_overrides_have_a_key_and_a_value_once(pairs: list[str]) -> None:
    with pytest.raises(SceneError, match="--set"):
        parse_overrides(pairs)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a",
        "3:",
        "4:4",
        "5:4",
        "-1:3",
        "1:2:3",
        "1,",
        "1,2:4",
        "3,1,1",
        f"0:{MAX_SEEDS + 1}",
        f"{2**63}:{2**63 + 1}",
    ],
)
def test_seeds_are_a_range_that_is_not_empty_or_a_list(text: str) -> None:
    with pytest.raises(SceneError, match="--seeds"):
        parse_seeds(text)


def test_a_single_number_of_seeds_is_ambiguous() -> None:
    """It ran one trial where five were meant."""
    for parse in (parse_seeds, parse_seed_range):
        with pytest.raises(SceneError, match="give 0:5 for 5 seeds or 5:6 for seed 5 alone"):
            parse("5")
        with pytest.raises(SceneError, match="give 0:1 for seed 0 alone"):
            parse("0")


def test_numbers_go_to_a_file_or_to_standard_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_output(None, "nowhere")
    write_output(Path("-"), "{}")
    assert capsys.readouterr().out == "{}"
    write_output(tmp_path / "numbers.json", "{}")
    assert (tmp_path / "numbers.json").read_text() == "{}"
    check_writable(tmp_path / "numbers.json")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere" / "numbers.json")
    for path in (tmp_path, tmp_path / "link"):
        with pytest.raises(SceneError, match="not a file in an existing folder"):
            check_writable(path)


def test_a_file_that_cannot_be_written_whole_leaves_the_older_one(tmp_path: Path, room: Room) -> None:
    older, link = tmp_path / "older.json", tmp_path / "link.json"
    older.write_text("older")
    older.chmod(0o640)
    link.symlink_to(older)
    with room(100), pytest.raises(MsrrError, match="cannot be written"):
        write_output(link, "x" * 1000)
    assert older.read_text() == "older"
    write_output(link, "newer")
    assert (older.read_text(), older.stat().st_mode & 0o777) == ("newer", 0o640)
    assert set(tmp_path.iterdir()) == {older, link}
    assert link.is_symlink()


def test_without_a_run_the_newest_one_is_taken(tmp_path: Path) -> None:
    assert run_or_last(Path("elsewhere")) == Path("elsewhere")
    with pytest.raises(SceneError, match="no run is here"):
        run_or_last(None)
    for age, name in ((20, "later"), (30, "sooner"), (10, "last"), (0, "no run")):
        folder = tmp_path / "runs" / name
        folder.mkdir(parents=True)
        file = folder / ("trial.mcap" if age else "notes.txt")
        file.write_bytes(b"")
        os.utime(file, (1e9 - age, 1e9 - age))
    assert run_or_last(None) == Path("runs/last")
    assert folder_of(run_or_last(None)) == folder_of(Path("runs/last/trial.mcap")) == Path("runs/last")
