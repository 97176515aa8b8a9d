"""The long-distance phases that come with the package, and how a scene chooses one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msrr_control.parameters import read_params
from msrr_control.path_following.c1 import C1PathFollowingLaw
from msrr_control.path_following.c2 import C2PathFollowingLaw
from msrr_control.sequence.observation import Assembler
from msrr_control.staging.parameters import AssemblyParams, C2AssemblyParams
from msrr_control.staging.setup import AssemblySetup
from msrr_control.staging.state_machine import LongDistanceAssembler
from msrr_scenes.errors import SceneError
from msrr_scenes.registry import build
from msrr_scenes.specs.spec import Choice


def c1(setup: AssemblySetup, **params: Any) -> Assembler:
    """Build the paper's long-distance phase C1."""
    checked = read_params("c1", AssemblyParams, params)
    return LongDistanceAssembler(checked, setup, C1PathFollowingLaw(checked, setup.limits, setup.offset))


def c2(setup: AssemblySetup, **params: Any) -> Assembler:
    """Build the long-distance phase of C2, our reading of the paper's comparison."""
    checked = read_params("c2", C2AssemblyParams, params)
    return LongDistanceAssembler(checked, setup, C2PathFollowingLaw(checked, setup.limits, setup.offset))


#: The long-distance phases by the names that a scene gives them.
ASSEMBLERS: dict[str, Callable[..., Assembler]] = {"c1": c1, "c2": c2}


def build_assembler(choice: Choice, setup: AssemblySetup) -> Assembler:
    """Build the long-distance phase that a scene names; it is called as ``Class(setup, **params)``.

    Raises:
        UnknownNameError: The name is neither registered nor an import path that leads anywhere.
        SceneError: The parameters are wrong, the class lacks a method or property, or the scene cannot work.
    """
    built = build("assembler", choice, ASSEMBLERS, setup)
    for member in ("reset", "step", "progress", "path"):
        if not hasattr(built, member):
            raise SceneError(f"assembler {choice.name!r} has no method or property {member}")
    return built
