"""Numbers of things in words."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from msrr_bullet.cli.app import run
from msrr_scenes.wording import counted


def test_one_thing_is_not_several() -> None:
    assert [counted(n, "tag") for n in (0, 1, 2)] == ["0 tags", "1 tag", "2 tags"]


def test_the_console_says_one_unit_of_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.yaml").write_text(
        "units: {a: {number: 0}, b: {number: 1, pose: {x_m: 0.7}}}\n"
        "obstacles: {post: {shape: cylinder, radius_m: 0.05, pose: {x_m: 0, y_m: 0.5}}}\n"
        "plan: [{unit: a, to: b.rear}]\n"
    )
    assert run(["check", str(tmp_path / "scene.yaml")]) == 0
    told = capsys.readouterr().out
    assert "2 units, 1 obstacle;" in told
    assert not re.search(r"\b1 \w+s\b", told)
