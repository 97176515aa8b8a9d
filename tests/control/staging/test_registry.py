from __future__ import annotations

import math
import sys
import types
from dataclasses import replace
from typing import Any

import pytest

from msrr_control.sequence.observation import GiveUp, Observation
from msrr_control.staging.registry import ASSEMBLERS, build_assembler
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.errors import SceneError, UnknownNameError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import AssemblyPath, AssemblyProgress, FailureReason, Twist
from msrr_scenes.specs.spec import Choice


@pytest.fixture(scope="module")
def setup() -> AssemblySetup:
    scene = load_scene("two_units")
    return AssemblySetup.of(scene, scene.plan[0])


def test_the_assembler_c2_is_built_from_a_scene() -> None:
    scene = load_scene("two_units", {"control.assembly": "{name: c2, params: {repulsion: {eta: 0.01}}}"})
    setup = AssemblySetup.of(scene, scene.plan[0])
    assembler = build_assembler(scene.control.assembly, setup)
    assert assembler.progress is None
    with pytest.raises(SceneError, match="assembler 'c2'"):
        build_assembler(Choice(name="c2", params={"repulsion": {"eta": -1.0}}), setup)


class _NoReport:
    """An assembler of a user's own that reports neither progress nor path."""

    def __init__(self, setup: AssemblySetup) -> None: ...
    def reset(self, reason: str) -> None: ...
    def step(self, observation: Observation) -> None: ...


def test_an_assembler_of_one_s_own_needs_the_whole_interface(
    setup: AssemblySetup, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = types.ModuleType("users_assembler")
    module.NoReport = _NoReport
    monkeypatch.setitem(sys.modules, "users_assembler", module)
    with pytest.raises(SceneError, match="no property progress"):
        build_assembler(Choice(name="users_assembler:NoReport"), setup)


PROGRESS = AssemblyProgress(0, "drive", 1, (0.0, 0.0), (0.1, 0.0), (0.1, 0.0), 0.1, 0.5, 1.0, None, "go")
PATH = AssemblyPath(0, 1, "arc", ((0.0, 0.0), (0.1, 0.0)), "free")


@pytest.mark.parametrize(
    ("member", "good", "bad", "why"),
    [
        ("step", Twist(0.1, 0.0), (0.1, 0.0), "expected a Twist, a GiveUp or None"),
        ("step", GiveUp(FailureReason.BLOCKED, "no way"), GiveUp("blocked", "no way"), "expected a Twist, a"),
        ("step", None, Twist(math.nan, 0.0), "two finite numbers"),
        ("progress", PROGRESS, PATH, "expected AssemblyProgress or None"),
        ("progress", PROGRESS, replace(PROGRESS, tip=None), "AssemblyProgress with a wrong tip"),
        ("progress", PROGRESS, replace(PROGRESS, s="far"), "AssemblyProgress with a wrong s"),
        ("progress", PROGRESS, replace(PROGRESS, tip=(0.0, math.nan)), "AssemblyProgress with a wrong tip"),
        ("path", PATH, replace(PATH, points=((0.0, object()),)), "AssemblyPath with a wrong points"),
        ("path", PATH, replace(PATH, points=((0.0, math.inf),)), "AssemblyPath with a wrong points"),
        ("path", PATH, replace(PATH, points=((0.0, 1e30),)), "a point 1e\\+30 m from the origin"),
        ("progress", PROGRESS, replace(PROGRESS, tip=(-200.0, 0.0)), "no farther than 100 m"),
        ("path", None, "arc", "expected AssemblyPath or None"),
    ],
)
def test_what_one_s_own_assembler_reports_is_checked(member: str, good: Any, bad: Any, why: str) -> None:
    """The log holds progress and path, and cannot write everything."""
    check = {**ASSEMBLERS.methods, **ASSEMBLERS.optional}[member]
    assert check(good) == good
    with pytest.raises(ValueError, match=why):
        check(bad)


def test_a_reason_can_be_written_and_has_a_length() -> None:
    reason = ASSEMBLERS.methods["step"](GiveUp(FailureReason.BLOCKED, "a \ud800 fence\n" * 100)).reason
    assert reason.startswith("a \\ud800 fence a")
    assert len(reason.encode()) == 300


@pytest.mark.parametrize(
    ("choice", "error", "says"),
    [
        (Choice(name="c3"), UnknownNameError, "Known: c1"),
        (Choice(name="c1", params={"envelop": False}), SceneError, "envelope"),
        (Choice(name="c1", params={"guidance": {"u_max_mps2": 0.1}}), SceneError, "less than u_max_mps2"),
        (Choice(name="c1", params={"pace": {"cruise_mps": 0.39}}), SceneError, "three quarters"),
        (Choice(name="c1", params={"route": {"border_m": 1.5}}), SceneError, "cannot move in it"),
    ],
)
def test_bad_choices_are_refused(
    setup: AssemblySetup, choice: Choice, error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        build_assembler(choice, setup)
    assert "c1" in ASSEMBLERS


def test_an_obstacle_that_no_circle_can_stand_for_is_refused(setup: AssemblySetup) -> None:
    fenced = replace(setup, obstacle_radius={"fence": 0.8})
    with pytest.raises(SceneError, match=r"obstacles\.fence: its radius is 0\.80 m"):
        build_assembler(Choice(name="c1"), fenced)
