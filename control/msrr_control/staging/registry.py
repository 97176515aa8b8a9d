"""The long-distance phases that ship, and how a scene chooses one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msrr_control.parameters import read_params
from msrr_control.path_following.baseline import C2PathFollowingLaw
from msrr_control.path_following.c1 import C1PathFollowingLaw
from msrr_control.sequence.observation import Assembler
from msrr_control.staging.parameters import AssemblyParams, C2AssemblyParams
from msrr_control.staging.setup import AssemblySetup
from msrr_control.staging.state_machine import LongDistanceAssembler
from msrr_scenes.errors import SceneError
from msrr_scenes.registry import build
from msrr_scenes.specs.spec import Choice


def c1(setup: AssemblySetup, **params: Any) -> Assembler:
    """Build the paper's long-distance phase C1."""
    chosen = read_params("c1", AssemblyParams, params)
    return LongDistanceAssembler(chosen, setup, C1PathFollowingLaw(chosen, setup.limits, setup.offset))


def c2(setup: AssemblySetup, **params: Any) -> Assembler:
    """Build the long-distance phase of the paper's comparison C2."""
    chosen = read_params("c2", C2AssemblyParams, params)
    return LongDistanceAssembler(
        chosen.paths(), setup, C2PathFollowingLaw(chosen, setup.limits, setup.offset)
    )


ASSEMBLERS: dict[str, Callable[..., Assembler]] = {"c1": c1, "c2": c2}


def build_assembler(choice: Choice, setup: AssemblySetup) -> Assembler:
    """Build the long-distance phase that a scene chose; it is called as ``Class(setup, **params)``.

    Raises:
        UnknownNameError: Neither a registered name nor an import path that leads anywhere.
        SceneError: Its parameters are wrong, or what the scene asks cannot work.
    """
    built = build("assembler", choice, ASSEMBLERS, setup)
    for method in ("reset", "step"):
        if not callable(getattr(built, method, None)):
            raise SceneError(f"assembler {choice.name!r} has no method {method}")
    return built
