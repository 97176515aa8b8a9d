"""Extension points: implementations that a scene names by a registered name or by an import path."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any, TypeVar

from msrr_scenes.errors import MsrrError, SceneError, UnknownNameError
from msrr_scenes.specs.spec import Choice

T = TypeVar("T")

_HINT = "One of your own is named by its import path, pkg.mod:Class."


def resolve(kind: str, name: str, table: Mapping[str, Callable[..., T]]) -> Callable[..., T]:
    """Return the class or factory with the given name.

    Args:
        kind: Kind of the extension point, for messages: ``detector``, ``renderer``, ``controller`` ...
        name: A key of ``table``, or an import path ``pkg.mod:Class`` (a dotted attribute is allowed).
        table: Registered implementations.

    Returns:
        The callable that builds the implementation. An import path is trusted to give the right type.

    Raises:
        UnknownNameError: There is no such registered name, no such module, or no such attribute in it.
        SceneError: The object at the path cannot be called.
    """
    if ":" not in name:
        try:
            return table[name]
        except KeyError:
            raise UnknownNameError(kind, name, table, _HINT) from None
    module_name, _, attribute = name.partition(":")
    try:
        found: Any = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        # Only a path that does not exist is a bad name; an import error inside the module is passed on.
        if error.name is None or not f"{module_name}.".startswith(f"{error.name}."):
            raise
        raise UnknownNameError(kind, name, table, f"No module named {error.name!r}. {_HINT}") from None
    except (TypeError, ValueError):  # an empty or relative module path
        raise UnknownNameError(kind, name, table, _HINT) from None
    try:
        found = attrgetter(attribute)(found)
    except AttributeError:
        hint = f"Module {module_name!r} has no attribute {attribute!r}."
        raise UnknownNameError(kind, name, table, hint) from None
    if not callable(found):
        raise SceneError(f"{kind} {name!r} is not a class or function, but {type(found).__name__}")
    built: Callable[..., T] = found
    return built


def build(kind: str, choice: Choice, table: Mapping[str, Callable[..., T]], *args: Any, **fixed: Any) -> T:
    """Return the implementation that a scene chose: ``resolve(...)(*args, **fixed, **choice.params)``.

    Raises:
        UnknownNameError: The name of the choice is unknown; see :func:`resolve`.
        SceneError: The implementation does not take the scene's parameters; the cause is attached.
    """
    factory = resolve(kind, choice.name, table)
    try:
        return factory(*args, **fixed, **choice.params)
    except MsrrError:
        raise
    except (TypeError, ValueError) as error:
        raise SceneError(f"{kind} {choice.name!r} does not take {choice.params}: {error}") from error
