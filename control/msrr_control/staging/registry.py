"""The long-distance phases that come with the package, and how a scene chooses one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, get_type_hints

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from msrr_control.docking.controller import checked_twist
from msrr_control.parameters import read_params
from msrr_control.path_following.c1 import C1PathFollowingLaw
from msrr_control.path_following.c2 import C2PathFollowingLaw
from msrr_control.path_following.law import PathFollowingLaw
from msrr_control.sequence.observation import Assembler, GiveUp
from msrr_control.staging.guided_assembler import GuidedAssembler
from msrr_control.staging.parameters import AssemblyParams, C2AssemblyParams, RouteFollowingParams
from msrr_control.staging.setup import AssemblySetup
from msrr_control.staging.state_machine import LongDistanceAssembler
from msrr_scenes.errors import SceneError
from msrr_scenes.guarded import Check, no_result, plain_text, wrong
from msrr_scenes.messages import AssemblyPath, AssemblyProgress, FailureReason, Twist
from msrr_scenes.registry import ExtensionPoint, build, naming_parameters
from msrr_scenes.specs.spec import Choice

#: Key of a scene that names an assembler.
_KEY = "control.assembly"

#: Parameters and law of the assemblers that are registered by name.
_LAWS: Mapping[str, tuple[type[RouteFollowingParams], Callable[..., PathFollowingLaw[Any]]]] = {
    "c1": (AssemblyParams, C1PathFollowingLaw),
    "c2": (C2AssemblyParams, C2PathFollowingLaw),
}


def _law(
    name: str, setup: AssemblySetup, params: dict[str, Any]
) -> tuple[RouteFollowingParams, PathFollowingLaw[Any]]:
    kind, law = _LAWS[name]
    checked = read_params(kind, params)
    return checked, law(checked, setup.limits, setup.offset)


def _assembler(name: str) -> Callable[..., Assembler]:
    """Return what builds the registered assembler of that name."""

    def build_it(setup: AssemblySetup, **params: Any) -> Assembler:
        checked, law = _law(name, setup, params)
        return LongDistanceAssembler(checked, setup, law)

    return build_it


def build_guided(choice: Choice, setup: AssemblySetup, reaction_s: float) -> GuidedAssembler[Any]:
    """Build the long-distance phase of a unit that a base station leads.

    ``reaction_s`` is that of :class:`msrr_control.tracks.authority.MovementAuthority`.

    Raises:
        SceneError: The parameters are wrong, or the law is none of those that a base station can lead.
    """
    if choice.name not in _LAWS:
        raise SceneError(
            f"{_KEY}: units that a base station leads drive by 'c1' or 'c2', found {choice.name!r}"
        )
    with naming_parameters(_KEY, f"assembler {choice.name!r}"):
        params, law = _law(choice.name, setup, choice.params)
    return GuidedAssembler(params, setup, law, reaction_s)


def route_params(choice: Choice) -> RouteFollowingParams | None:
    """Return the parameters of the registered assembler that a scene names; None for any other.

    Raises:
        SceneError: The parameters are wrong.
    """
    if choice.name not in _LAWS:
        return None
    kind, _ = _LAWS[choice.name]
    with naming_parameters(_KEY, f"assembler {choice.name!r}"):
        return read_params(kind, choice.params)


#: Distance beyond which no point of the arena lies [m].
_FARTHEST_M = 100.0


def _decision(result: object, *_: object) -> Twist | GiveUp | None:
    if result is None:
        return None
    if isinstance(result, GiveUp) and isinstance(result.failure, FailureReason):
        return GiveUp(result.failure, plain_text(str(result.reason)))
    if not isinstance(result, Twist):
        wrong(result, "a Twist, a GiveUp or None")
    return checked_twist(result)


def _report(kind: type[AssemblyProgress] | type[AssemblyPath]) -> Check:
    # What is drawn has a place.
    finite = ConfigDict(allow_inf_nan=False)
    fields = {name: TypeAdapter(hint, config=finite) for name, hint in get_type_hints(kind).items()}

    def check(result: object) -> object:
        if result is not None and not isinstance(result, kind):
            wrong(result, f"{kind.__name__} or None")
        for name, field in fields.items() if result is not None else ():
            try:
                field.validate_python(getattr(result, name), strict=True)
            except ValidationError as error:
                why = error.errors()[0]["msg"]
                raise ValueError(f"{kind.__name__} with a wrong {name}: {why}") from None
            value = getattr(result, name)
            if isinstance(value, tuple) and value and np.abs(value).max() > _FARTHEST_M:
                far = f"{np.abs(value).max():g} m from the origin"
                raise ValueError(
                    f"{kind.__name__} with a wrong {name}: a point {far}; expected points in metres, "
                    f"no farther than {_FARTHEST_M:g} m"
                )
        return result

    return check


#: The long-distance phases by the names that a scene gives them: the paper's C1, and C2, our reading of its
#: comparison.
ASSEMBLERS: ExtensionPoint[Assembler] = ExtensionPoint(
    "assembler",
    {name: _assembler(name) for name in _LAWS},
    methods={"reset": no_result, "step": _decision},
    optional={"progress": _report(AssemblyProgress), "path": _report(AssemblyPath)},
)


def build_assembler(choice: Choice, setup: AssemblySetup) -> Assembler:
    """Build the long-distance phase that a scene names; it is called as ``Class(setup, **params)``.

    Raises:
        UnknownNameError: The name is neither registered nor an import path that leads anywhere.
        SceneError: The parameters are wrong, the class lacks a method or property, or the scene cannot work.
    """
    built = build(_KEY, choice, ASSEMBLERS, setup)
    for member in ("progress", "path"):
        if not hasattr(built, member):
            raise SceneError(f"{_KEY}: assembler {choice.name!r} has no property {member}")
    return built
