"""Options that several commands share: overrides, seeds, and the file of numbers."""

from pathlib import Path

import pytest

from msrr_bullet.cli.options import check_writable, parse_overrides, parse_seeds, write_json
from msrr_scenes.errors import SceneError


def test_overrides_and_seeds() -> None:
    assert parse_overrides(["a.b=1", "c=x=y", "d="]) == {"a.b": "1", "c": "x=y", "d": ""}
    assert parse_overrides(None) == {}
    assert parse_seeds("3:6") == range(3, 6)
    assert parse_seeds("7") == range(7, 8)


@pytest.mark.parametrize("pairs", [["a"], ["=1"], ["a=1", "a=2"]])
def test_overrides_have_a_key_and_a_value_once(pairs: list[str]) -> None:
    with pytest.raises(SceneError, match="--set"):
        parse_overrides(pairs)


@pytest.mark.parametrize("text", ["", "a", "3:", "4:4", "5:4", "-1:3", "1:2:3"])
def test_seeds_are_a_range_that_is_not_empty(text: str) -> None:
    with pytest.raises(SceneError, match="--seeds"):
        parse_seeds(text)


def test_numbers_go_to_a_file_or_to_standard_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_json(None, "nowhere")
    write_json(Path("-"), "{}")
    assert capsys.readouterr().out == "{}"
    write_json(tmp_path / "numbers.json", "{}")
    assert (tmp_path / "numbers.json").read_text() == "{}"
    check_writable(tmp_path / "numbers.json")
    with pytest.raises(SceneError, match="not a file in an existing folder"):
        check_writable(tmp_path)
