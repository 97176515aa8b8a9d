"""Extension points: implementations that a scene names by a registered name or by an import path."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from operator import attrgetter
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from msrr_scenes.errors import (
    ChangedFileError,
    MissingPackageError,
    MsrrError,
    ParameterError,
    SceneError,
    StoppedError,
    UnknownNameError,
    nearest,
)
from msrr_scenes.guarded import Check, Guarded, failure, file_of, in_one_line, numpy_errors, raised_at
from msrr_scenes.own_modules import import_own
from msrr_scenes.specs.spec import Choice

T = TypeVar("T")

_HINT = (
    "One of your own is named by its import path, pkg.mod:Class; "
    "pkg has to be installed, on PYTHONPATH or in the current folder."
)


class ExtensionPoint(Mapping[str, Callable[..., T]]):
    """The registered implementations of a protocol by name, and what a class of a user's own has to fulfil.

    Attributes:
        kind: What its implementations are, for messages: ``detector``, ``renderer``, ``controller`` ...
        methods: Methods that a class has to have, and the check of the result of each.
        optional: Members that an object may have, and the check of each.
    """

    def __init__(
        self,
        kind: str,
        registered: Mapping[str, Callable[..., T]],
        methods: Mapping[str, Check],
        optional: Mapping[str, Check] | None = None,
    ) -> None:
        """Describe an extension point."""
        self.kind = kind
        self._registered = dict(registered)
        self.methods, self.optional = dict(methods), dict(optional or {})

    def __getitem__(self, name: str) -> Callable[..., T]:
        return self._registered[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._registered)

    def __len__(self) -> int:
        return len(self._registered)


def is_import_path(choice: Choice) -> bool:
    """Return whether a scene names an implementation by its import path, so that its module is run."""
    return ":" in choice.name


def choices(value: object) -> Iterator[Choice]:
    """Yield every implementation that a specification names, at any depth."""
    if isinstance(value, Choice):
        yield value
    elif isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield from choices(getattr(value, name))


def resolve(key: str, name: str, table: ExtensionPoint[T]) -> Callable[..., T]:
    """Return the class or factory with the given name.

    Args:
        key: Dotted key of the choice in a scene, with which messages begin: ``control.docking`` ...
        name: A key of ``table``, or an import path ``pkg.mod:Class`` (a dotted attribute is allowed). The
            module is looked for in the current folder too, and is run when it is imported.
        table: The extension point.

    Returns:
        The callable that builds the implementation: a registered one, or a class with the methods of the
        protocol.

    Raises:
        UnknownNameError: There is no such registered name, no such module, or no such attribute in it.
        SceneError: The object at the path is not a class with the methods of the protocol, or its module
            fails when it is imported.
    """
    if ":" not in name:
        try:
            return table[name]
        except KeyError:
            raise UnknownNameError(table.kind, name, table, _HINT, key) from None
    found = _import(key, name, table)
    what = f"{key}: {table.kind} {name!r}"
    needed = f"every {table.kind} is a class with the methods {', '.join(table.methods)}"
    if not inspect.isclass(found):
        raise SceneError(f"{what} is not a class (found: {type(found).__name__}); {needed}")
    lacking = [method for method in table.methods if not callable(getattr(found, method, None))]
    if lacking:
        raise SceneError(f"{what} has no method {', '.join(lacking)}; {needed}")
    return cast("Callable[..., T]", found)


def _import(key: str, name: str, table: ExtensionPoint[T]) -> object:
    """Return the object at an import path."""
    module_name, _, attribute = name.partition(":")
    if not all(part.isidentifier() for part in module_name.split(".")):
        raise UnknownNameError(table.kind, name, table, _HINT, key)
    try:
        with numpy_errors():
            module = import_own(module_name)
    except ChangedFileError as error:
        raise ChangedFileError(f"{table.kind} {name!r}: {error}") from None
    except (KeyboardInterrupt, StoppedError):
        raise
    except BaseException as error:
        # Only a path that does not exist is a bad name; an import error inside the module is its own.
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing is not None and f"{module_name}.".startswith(f"{missing}."):
            hint = f"No module named {missing!r}. {_HINT}"
            raise UnknownNameError(table.kind, name, table, hint, key) from None
        place = raised_at(error, f"{module_name.rpartition('.')[2]}.py")
        raise SceneError(
            f"{key}: the module of {table.kind} {name!r} cannot be imported, {place}: {in_one_line(error)}"
        ) from error
    try:
        return attrgetter(attribute)(module)
    except AttributeError:
        file = getattr(module, "__file__", None)  # it may be another one than the author of the scene thinks
        place = f", which is {file}," if file else ""
        hint = f"Module {module_name!r}{place} has no attribute {attribute!r}."
        if module_name == "__main__":  # in the process of a sweep or of a replay
            hint += " It is another one in every process: write a class of a notebook's cell to a file."
        raise UnknownNameError(table.kind, name, table, hint, key) from None


def build(key: str, choice: Choice, table: ExtensionPoint[T], *args: Any, **fixed: Any) -> T:
    """Return the implementation that a scene chose: ``resolve(...)(*args, **fixed, **choice.params)``.

    An object of a class that is named by its import path is :class:`Guarded`.

    Raises:
        UnknownNameError: The name of the choice is unknown; see :func:`resolve`.
        SceneError: The implementation does not take the scene's parameters; the message begins with the key
            of the parameter, or of the choice, and the cause is attached. A package may be missing.
        ProgramFailedError: A class that is named by its import path fails while it is built.
    """
    factory = resolve(key, choice.name, table)
    own = cast(type, factory) if is_import_path(choice) else None
    what = f"{table.kind} {choice.name!r}"
    misfit = f"{key}: {what} cannot be built"
    if choice.params:
        misfit = f"{key}.params: {what} does not take {choice.params}"
    if own is not None:
        try:
            _signature(own).bind(*args, **fixed, **choice.params)
        except TypeError as error:
            unknown = _unknown_parameter(own, args, fixed, choice.params)
            if unknown is not None:
                raise SceneError(f"{key}.params.{unknown[0]}: {what} does not take {unknown[1]}") from error
            given = [type(arg).__name__ for arg in args]
            given += [f"{name}={value!r}" for name, value in {**fixed, **choice.params}.items()]
            raise SceneError(f"{key}: {what} does not take ({', '.join(given)}): {error}") from error
    try:
        with numpy_errors(), naming_parameters(key, what):
            built = factory(*args, **fixed, **deepcopy(choice.params))  # a class may change what it is given
    except MissingPackageError as error:
        raise SceneError(f"{key}: {error}") from error
    except (KeyboardInterrupt, StoppedError, MsrrError):
        raise
    except BaseException as error:
        if own is None and isinstance(error, ValueError | TypeError):
            unknown = _unknown_parameter(factory, args, fixed, choice.params)
            if unknown is not None:
                raise SceneError(f"{key}.params.{unknown[0]}: {what} does not take {unknown[1]}") from error
            raise SceneError(f"{misfit}: {error}") from error
        if own is None:
            raise
        if isinstance(error, ValueError):  # of the parameters, or of a mistake: the line tells
            raise SceneError(f"{misfit}, {raised_at(error, file_of(own))}: {in_one_line(error)}") from error
        raise failure(table.kind, choice.name, own, "__init__", error) from error
    if own is None:
        return built
    lacking = [method for method in table.methods if not callable(getattr(built, method, None))]
    if lacking:  # its __new__ returns something else
        found = f"an object of type {type(built).__name__}, which has no method {', '.join(lacking)}"
        raise SceneError(f"{key}: {what}: building it gave {found}")
    return cast(T, Guarded(table.kind, choice.name, built, {**table.methods, **table.optional}))


@contextmanager
def naming_parameters(key: str, what: str) -> Iterator[None]:
    """Let what is wrong with parameters of a choice, at a dotted key, begin with their keys in the scene.

    ``what`` is the kind and the name of the implementation.

    Raises:
        SceneError: In the place of a :class:`ParameterError`; a line for each parameter.
    """
    try:
        yield
    except ParameterError as error:
        keys = {f"{key}.params.{name}".rstrip("."): text for name, text in error.faults.items()}
        raise SceneError("\n".join(f"{at}: {what}: {text}" for at, text in keys.items())) from error


def require_in_range(
    ranges: Mapping[str, tuple[float, float]], values: Mapping[str, object], optional: Collection[str] = ()
) -> None:
    """Refuse parameters that are no numbers of their ranges, from the lowest to the highest value.

    ``values`` may hold other parameters as well; those named in ``optional`` may be None.

    Raises:
        ParameterError: One or more of them are not.
    """
    faults = dict[str, str]()
    for name, (low, high) in ranges.items():
        value = values[name]
        if value is None and name in optional:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            faults[name] = f"has to be a number from {low:g} to {high:g}, found {value!r:.40}"
    if faults:
        raise ParameterError(faults)


def _unknown_parameter(
    factory: Callable[..., object],
    args: tuple[object, ...],
    fixed: Mapping[str, object],
    params: Mapping[str, Any],
) -> tuple[str, str] | None:
    """Return the first parameter that a factory does not know, and what to say; None if it knows all."""
    signature = _signature(factory)
    try:
        given = signature.bind_partial(*args, **fixed).arguments
    except TypeError:  # it does not take what the testbed passes either
        return None
    parameters = signature.parameters.values()
    if any(each.kind is each.VAR_KEYWORD for each in parameters):
        return None
    named = [each.name for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]
    known = [name for name in named if name not in given]
    unknown = next((name for name in params if name not in known), None)
    if unknown is None:
        return None
    return unknown, f"{unknown!r}{nearest(unknown, known)} Parameters here: {', '.join(known) or 'none'}"


def _signature(cls: Callable[..., object]) -> inspect.Signature:
    """Return the signature with which a class is built; one that takes anything if it cannot be told."""
    try:
        return inspect.signature(cls)
    except ValueError:
        return inspect.signature(lambda *args, **kwargs: None)
