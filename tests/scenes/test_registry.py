from __future__ import annotations

import sys
from pathlib import Path

import pytest

from msrr_scenes.errors import SceneError, UnknownNameError
from msrr_scenes.registry import build, resolve
from msrr_scenes.specs.spec import Choice


class Thing:
    class Inner:
        pass

    def __init__(self, base: int, size: int = 1) -> None:
        if size < 0:
            raise ValueError("size must not be negative")
        self.base, self.size = base, size


NOT_CALLABLE = 3
TABLE = {"thing": Thing}


def test_a_registered_name_gives_its_class() -> None:
    assert resolve("gadget", "thing", TABLE) is Thing


def test_an_import_path_gives_the_attribute() -> None:
    from fractions import Fraction

    assert resolve("gadget", "fractions:Fraction", TABLE) is Fraction
    assert resolve("gadget", "fractions:Fraction.from_float", TABLE) == Fraction.from_float


def test_a_misspelt_name_lists_the_nearest_and_all() -> None:
    with pytest.raises(
        UnknownNameError, match=r"unknown gadget 'thign'; did you mean 'thing'\? Known: thing"
    ):
        resolve("gadget", "thign", TABLE)


@pytest.mark.parametrize(
    ("path", "why"),
    [
        ("no_such_pkg.mod:Class", "No module named 'no_such_pkg'"),
        ("fractions.nothing:Class", "No module named 'fractions.nothing'"),
        ("fractions:Nothing", "no attribute 'Nothing'"),
        ("fractions:", "no attribute ''"),
        (":Class", "pkg.mod:Class"),
        (".relative:Class", "pkg.mod:Class"),
    ],
)
def test_a_path_that_leads_nowhere_says_where_it_ends(path: str, why: str) -> None:
    with pytest.raises(UnknownNameError, match=why):
        resolve("gadget", path, TABLE)


def test_what_cannot_be_called_is_refused() -> None:
    with pytest.raises(SceneError, match="is not a class or function, but float"):
        resolve("gadget", "math:pi", TABLE)


def test_a_module_that_fails_inside_shows_its_own_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_gadget.py").write_text("import no_such_dependency_of_it\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="no_such_dependency_of_it"):
        resolve("gadget", "broken_gadget:Thing", TABLE)
    assert "broken_gadget" not in sys.modules


def test_build_passes_arguments_and_the_scenes_parameters() -> None:
    thing = build("gadget", Choice(name="thing", params={"size": 4}), TABLE, 7)
    assert (thing.base, thing.size) == (7, 4)


@pytest.mark.parametrize("params", [{"colour": 1}, {"size": -1}])
def test_build_blames_the_scene_for_parameters_that_do_not_fit(params: dict[str, int]) -> None:
    with pytest.raises(SceneError, match=r"gadget 'thing' does not take") as caught:
        build("gadget", Choice(name="thing", params=params), TABLE, 7)
    assert isinstance(caught.value.__cause__, (TypeError, ValueError))
