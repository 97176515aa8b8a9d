"""The tables of docs/explanation/architecture.md say what the code does."""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

import pytest

from msrr_bullet.trial.trial import Trial
from msrr_scenes.specs.scene import Scene
from tests.conftest import load_script

DOCS = Path(__file__).resolve().parents[1] / "docs"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return load_script(DOCS / "make_architecture.py")


def test_the_page_is_what_the_script_writes(script: ModuleType) -> None:
    text = script.PAGE.read_text()
    assert script.page(text) == text, "run `python docs/make_architecture.py`"


def test_packages_form_no_circle_and_at_most_seven_levels(script: ModuleType) -> None:
    for root in script.ROOTS:
        assert max(script.levels(script.package_graph(root)).values()) <= 7


def test_a_circle_is_an_error(script: ModuleType) -> None:
    with pytest.raises(ValueError, match="a -> b -> a"):
        script.levels({"a": frozenset("b"), "b": frozenset("a")})


def test_implied_imports_are_not_listed(script: ModuleType) -> None:
    graph = {"a": frozenset("bc"), "b": frozenset("c"), "c": frozenset()}
    assert script.reduced(graph)["a"] == frozenset("b")


def test_a_frame_takes_the_way_of_the_table(script: ModuleType, shipped: Callable[..., Scene]) -> None:
    """In a running trial every function of the table is called after the one before it."""
    way = [_function(path) for path, _ in script.FRAME]
    codes = {function.__code__ for function in way}
    calls: list[Any] = []

    def note(frame: FrameType, event: str, argument: object) -> None:
        if event == "call" and frame.f_code in codes:
            calls.append(frame.f_code)

    trial = Trial(shipped("two_units", {"time_limit_s": "5.5", **_NEAR}), 1)
    sys.setprofile(note)
    try:
        trial.run()
    finally:
        sys.setprofile(None)
    place = calls.index(way[0].__code__)
    for function in way:
        assert function.__code__ in calls[place:], f"{function.__qualname__} is not called in its place"
        place = calls.index(function.__code__, place) + (function is not way[0])


#: The unit starts just before the hand-over, so that the docking phase begins after 4.4 s.
_NEAR = {"units.a.pose.x_m": "-0.1", "units.a.pose.y_m": "0.05", "units.a.pose.yaw_deg": "20"}


def _function(path: str) -> Callable[..., Any]:
    module, _, name = path.partition(":")
    owner, _, method = name.partition(".")
    found = inspect.getattr_static(getattr(importlib.import_module(module), owner), method)
    assert inspect.isfunction(found), path
    return found
