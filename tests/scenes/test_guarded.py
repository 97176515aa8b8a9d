"""Objects of a user's classes: what goes through unchanged, and how a failure is named."""

from __future__ import annotations

import inspect
from asyncio import CancelledError
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import pytest

from msrr_bullet.cli.exit_codes import Terminated
from msrr_scenes.errors import ProgramFailedError, SceneError
from msrr_scenes.guarded import Guarded, in_one_line, no_result, of_the_same_kind, unguarded, wrong


def even(result: Any, *arguments: Any) -> int:
    if not isinstance(result, int) or result % 2:
        wrong(result, f"an even number for {arguments}")
    return result


CHECKS = {"double": even, "forget": no_result, "for_large": of_the_same_kind, "state": even}


class Doubler:
    state = 4

    def double(self, x: Any) -> Any:
        return x + x

    def forget(self) -> str:
        return "done"

    def for_large(self) -> Any:
        return Doubler()


class Faulty(Doubler):
    other: Any = None

    def double(self, x: Any) -> Any:
        if isinstance(x, BaseException):
            raise x
        return x

    @property
    def state(self) -> int:
        raise AttributeError("no state")

    def for_large(self) -> Any:
        return self.other


def guarded(inner: object) -> Any:
    return Guarded("gadget", "mine:Thing", inner, CHECKS)


def test_what_is_allowed_goes_through() -> None:
    thing = guarded(Doubler())
    assert thing.double(3) == 6
    assert thing.state == 4
    assert thing.forget() is None
    assert thing.for_large().double(2) == 4
    assert not hasattr(thing, "colour")
    assert not hasattr(Guarded("gadget", "mine:Thing", object(), CHECKS), "for_large")
    assert isinstance(unguarded(thing), Doubler)


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        (None, r"double returned None; expected an even number for \(None,\)"),
        (3, "double returned 3; expected"),
        (SystemExit(3), r"test_guarded.py line \d+: double raised SystemExit: 3"),
        (SceneError("not here"), "double raised msrr_scenes.errors.SceneError: not here"),
        (StopIteration(), "double raised StopIteration"),
        (GeneratorExit(), "double raised GeneratorExit"),
        (CancelledError(), "double raised asyncio.exceptions.CancelledError"),
    ],
)
def test_a_failure_names_class_file_and_line(argument: object, says: str) -> None:
    with pytest.raises(ProgramFailedError, match=r"'mine:Thing', test_guarded\.py line") as caught:
        guarded(Faulty()).double(argument)
    with pytest.raises(ProgramFailedError, match=says):
        raise caught.value


@pytest.mark.parametrize("stop", [KeyboardInterrupt(), Terminated(15)])
def test_what_ends_the_program_is_no_failure_of_the_class(stop: BaseException) -> None:
    with pytest.raises(type(stop)) as caught:
        guarded(Faulty()).double(stop)
    assert caught.value is stop


def test_a_method_with_other_arguments_is_named_where_it_is_defined() -> None:
    def without_argument(_: object) -> int:
        return 2

    narrow = type("Narrow", (Doubler,), {"double": without_argument})
    line = without_argument.__code__.co_firstlineno
    with pytest.raises(ProgramFailedError, match=rf"test_guarded\.py line {line}: double raised TypeError"):
        guarded(narrow()).double(1)


class Inheriting(PurePosixPath):
    """Has a method of another file."""


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("a", r"with_suffix raised ValueError: Invalid suffix 'a', at pathlib\.py line \d+"),
        (".a", r"with_suffix returned Inheriting\('x\.a'\); expected an even number"),
    ],
)
def test_a_method_that_is_inherited_from_another_file_is_named_by_its_class(argument: str, says: str) -> None:
    """What goes wrong there comes from what the class has made of it."""
    thing: Any = Guarded("gadget", "mine:Thing", Inheriting("x"), {"with_suffix": even})
    _, line = inspect.getsourcelines(Inheriting)
    with pytest.raises(ProgramFailedError, match=rf"'mine:Thing', test_guarded\.py line {line}: {says}"):
        thing.with_suffix(argument)


def test_a_property_that_fails_is_not_a_missing_one() -> None:
    """Else an AttributeError inside of it would pass for a class without the property."""
    with pytest.raises(ProgramFailedError, match="state raised AttributeError: no state"):
        _ = guarded(Faulty()).state


def test_another_object_of_the_kind_is_guarded_too() -> None:
    inner = Faulty()
    with pytest.raises(ProgramFailedError, match="for_large returned None; expected a gadget with double"):
        guarded(inner).for_large()
    inner.other = inner
    thing = guarded(inner)
    assert thing.for_large() is thing
    inner.other = Faulty()
    with pytest.raises(ProgramFailedError, match="returned 1;"):
        guarded(inner).for_large().double(1)


def test_what_a_class_makes_of_numpy_s_warnings_ends_with_its_call() -> None:
    class Strict(Doubler):
        def double(self, x: Any) -> Any:
            np.seterr(all="raise")
            return x + x

    before = np.geterr()
    guarded(Strict()).double(1)
    assert np.geterr() == before


def test_a_failure_reads_the_same_in_every_process() -> None:
    """Its text is logged, and a replay compares it."""
    texts = {in_one_line(ValueError(f"bad\n {object()} \ud800 \x1b[31mé")) for _ in range(3)}
    assert texts == {"ValueError: bad <object object at 0x...> \\ud800 \\x1b[31mé"}
    assert len(in_one_line(ValueError("x" * 10_000))) == 300


def test_a_result_whose_own_methods_fail_is_a_failure_too() -> None:
    class Unprintable:
        def __repr__(self) -> str:
            raise RuntimeError("no name")

    with pytest.raises(ProgramFailedError, match="double raised RuntimeError: no name"):
        guarded(Faulty()).double(Unprintable())
