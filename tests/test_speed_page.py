"""The page docs/results/speed.md is made of the comparisons that are stored beside it."""

from __future__ import annotations

import shlex
from pathlib import Path
from types import ModuleType

import pytest

from msrr_bullet.bench.speed_comparison import variants_of
from tests.conftest import load_script

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return load_script(ROOT / "docs" / "make_speed.py")


def test_the_page_is_what_the_script_writes(script: ModuleType) -> None:
    assert script.page() == (script.RESULTS / "speed.md").read_text(), "run `python docs/make_speed.py`"


def test_the_commands_compare_what_is_stored(script: ModuleType) -> None:
    for name, _, options in script.COMPARED:
        scene, *words = shlex.split(options)
        given: dict[str, list[str]] = {"--grade": [], "--units": []}
        for option, value in zip(words[::2], words[1::2], strict=True):
            given[option].append(value)
        variants = variants_of(scene, {}, given["--grade"], [int(number) for number in given["--units"]])
        stored = script.comparison(name)
        assert list(stored.variants) == list(variants)
        assert stored.scene == next(iter(variants.values())).name
