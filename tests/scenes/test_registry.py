from __future__ import annotations

import pickle
import sys
import types
from pathlib import Path

import pytest

from msrr_scenes.errors import ProgramFailedError, SceneError, UnknownNameError
from msrr_scenes.guarded import no_result
from msrr_scenes.loading.load import load_scene
from msrr_scenes.registry import ExtensionPoint, build, choices, is_import_path, resolve
from msrr_scenes.specs.spec import Choice


class Thing:
    class Inner:
        pass

    def __init__(self, base: int, size: int = 1) -> None:
        if size < 0:
            raise ValueError("size must not be negative")
        self.base, self.size = base, size

    def limit_denominator(self) -> None:
        """Do what Fraction has a method for too, so that Fraction fulfils the protocol."""


TABLE = ExtensionPoint("gadget", {"thing": Thing}, methods={"limit_denominator": no_result})


def test_a_registered_name_gives_its_class() -> None:
    assert resolve("toys.gadget", "thing", TABLE) is Thing


def test_an_import_path_gives_the_attribute() -> None:
    from fractions import Fraction

    assert resolve("toys.gadget", "fractions:Fraction", TABLE) is Fraction


def test_a_misspelt_name_lists_the_nearest_and_all() -> None:
    with pytest.raises(
        UnknownNameError, match=r"unknown gadget 'thign'; did you mean 'thing'\? Known: thing"
    ):
        resolve("toys.gadget", "thign", TABLE)


@pytest.mark.parametrize(
    ("path", "why"),
    [
        ("no_such_pkg.mod:Class", "No module named 'no_such_pkg'"),
        ("fractions.nothing:Class", "No module named 'fractions.nothing'"),
        ("fractions:Nothing", r"Module 'fractions', which is .*fractions\.py, has no attribute 'Nothing'"),
        ("fractions:", "no attribute ''"),
        ("__main__:Cell", "no attribute 'Cell'. It is another one in every process: write a class"),
        (":Class", "pkg.mod:Class"),
        (".relative:Class", "pkg.mod:Class"),
    ],
)
def test_a_path_that_leads_nowhere_says_where_it_ends(path: str, why: str) -> None:
    with pytest.raises(UnknownNameError, match=why):
        resolve("toys.gadget", path, TABLE)


@pytest.mark.parametrize(
    ("path", "why"),
    [
        ("subprocess:check_call", r"is not a class \(found: function\)"),
        ("fractions:Fraction.from_float", r"is not a class \(found: method\)"),
        ("math:pi", r"is not a class \(found: float\)"),
        ("subprocess:Popen", "has no method limit_denominator"),
    ],
)
def test_only_a_class_with_the_methods_of_the_protocol_is_built(path: str, why: str) -> None:
    """``subprocess:check_call`` ran as a controller, with the scene's parameters."""
    with pytest.raises(
        SceneError, match=f"{why}; every gadget is a class with the methods limit_denominator"
    ):
        build("toys.gadget", Choice(name=path, params={"args": ["false"]}), TABLE)


class Other(Thing):
    def __new__(cls, *args: object, **params: object) -> object:  # type: ignore[misc]  # a slip of its author
        return None


def test_a_class_whose_object_is_of_another_type_is_refused() -> None:
    with pytest.raises(
        SceneError, match="building it gave an object of type NoneType, which has no method li"
    ):
        build("toys.gadget", Choice(name=f"{__name__}:Other"), TABLE, 1)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (
            "import no_such_dependency_of_it",
            r"gadget.py line 1: ModuleNotFoundError: No module named",
        ),
        ("x = 1\nraise ValueError('no luck')", r"gadget.py line 2: ValueError: no luck"),
        ("x = 1\ndef f(:", r"gadget.py line 2: SyntaxError: invalid syntax"),
        ("import sys\nsys.exit(0)", r"gadget.py line 2: SystemExit: 0"),
        ("x = 1\nraise GeneratorExit", r"gadget.py line 2: GeneratorExit"),
    ],
)
def test_a_module_that_cannot_be_imported_says_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, why: str
) -> None:
    name = f"{tmp_path.name.strip('_')}_gadget"  # the tests of a process share its modules
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SceneError, match=why):
        resolve("toys.gadget", f"{name}:Thing", TABLE)
    assert name not in sys.modules


def test_a_module_in_the_current_folder_is_found_and_replaces_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gadget_of_mine.py").write_text("class Thing:\n    def limit_denominator(self): ...\n")
    (tmp_path / "colorsys.py").write_text("class Thing:\n    def limit_denominator(self): ...\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    before = list(sys.path)
    assert resolve("toys.gadget", "gadget_of_mine:Thing", TABLE).__module__ == "gadget_of_mine"
    with pytest.raises(UnknownNameError, match=r"'colorsys', which is .*, has no attribute 'Thing'"):
        resolve("toys.gadget", "colorsys:Thing", TABLE)  # Python's own
    assert sys.path == before


class Fragile:
    """A class of a user's own that fails while it is built."""

    def __init__(self, how: str = "") -> None:
        if how == "value":
            raise ValueError("no such colour")
        raise ZeroDivisionError("one too many")

    def limit_denominator(self) -> None: ...


def test_a_class_that_fails_while_it_is_built_is_named_with_file_and_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    module = types.ModuleType("fragile_gadget")
    module.Fragile = Fragile
    monkeypatch.setitem(sys.modules, "fragile_gadget", module)
    name = "fragile_gadget:Fragile"
    with pytest.raises(ProgramFailedError, match=r"Fragile', test_registry.py line \d+: __init__"):
        build("toys.gadget", Choice(name=name), TABLE)
    for params in ({"how": "value"}, {"colour": 1}):  # both are for the writer of the scene
        with pytest.raises(SceneError, match="does not take"):
            build("toys.gadget", Choice(name=name, params=params), TABLE)
    # Of numpy it may be a mistake in the class as well, of which the message alone does not tell the place.
    with pytest.raises(SceneError, match=r"test_registry\.py line \d+: ValueError: no such colour"):
        build("toys.gadget", Choice(name=name, params={"how": "value"}), TABLE)


class Bare:
    def limit_denominator(self) -> None: ...


def test_a_class_that_cannot_be_built_is_told_all_that_it_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the testbed passes as well, for that is what the class of a beginner does not take."""
    module = types.ModuleType("bare_gadget")
    module.Bare = Bare
    monkeypatch.setitem(sys.modules, "bare_gadget", module)
    choice = Choice(name="bare_gadget:Bare", params={"gain": 2})
    with pytest.raises(SceneError, match=r"Bare' does not take \(Scene, late=True, gain=2\): "):
        build("toys.gadget", choice, TABLE, load_scene("close_range"), late=True)


def test_the_implementations_that_a_scene_names_are_found_at_any_depth() -> None:
    scene = load_scene("two_units", {"as_built": "perfect", "cameras.overhead.renderer": "mine:Renderer"})
    assert {c.name for c in choices(scene) if is_import_path(c)} == {"mine:Renderer"}
    assert {c.name for c in choices(scene)} >= {"raster", "pupil", "corner_ekf", "cbf", "c1"}


def test_build_passes_arguments_and_the_scenes_parameters() -> None:
    thing = build("toys.gadget", Choice(name="thing", params={"size": 4}), TABLE, 7)
    assert (thing.base, thing.size) == (7, 4)


@pytest.mark.parametrize("params", [{"colour": 1}, {"size": -1}])
def test_build_blames_the_scene_for_parameters_that_do_not_fit(params: dict[str, int]) -> None:
    with pytest.raises(SceneError, match=r"gadget 'thing' does not take") as caught:
        build("toys.gadget", Choice(name="thing", params=params), TABLE, 7)
    assert isinstance(caught.value.__cause__, (TypeError, ValueError))


def test_an_unknown_parameter_is_named_with_those_that_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    says = r"does not take 'siz'; did you mean 'size'\? Parameters here: size$"
    module = types.ModuleType("sized_gadget")
    module.Thing = Thing
    monkeypatch.setitem(sys.modules, "sized_gadget", module)
    for name in ("thing", "sized_gadget:Thing"):
        with pytest.raises(SceneError, match=says):
            build("toys.gadget", Choice(name=name, params={"siz": 1}), TABLE, 7)


def test_a_class_that_changes_its_parameters_does_not_change_the_scene() -> None:
    """The second trial of a scene was another one than the first."""

    class Greedy(Thing):
        def __init__(self, sizes: list[int]) -> None:
            sizes.append(2)
            super().__init__(sum(sizes))

    choice = Choice(name="greedy", params={"sizes": [1]})
    table = ExtensionPoint("gadget", {"greedy": Greedy}, methods=TABLE.methods)
    assert [build("toys.gadget", choice, table).base for _ in range(3)] == [3, 3, 3]
    assert choice.params == {"sizes": [1]}


def test_an_unknown_name_comes_back_from_another_process() -> None:
    """It could not be unpickled, so that a sweep said of every trial that its process died."""
    error = UnknownNameError("gadget", "thin", ["thing"], "Or an import path.")
    again = pickle.loads(pickle.dumps(error))  # noqa: S301 - what this test has pickled itself
    assert isinstance(again, UnknownNameError)
    assert str(again) == str(error)
