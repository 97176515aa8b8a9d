"""Overrides: values that the command line or Python puts in the place of those of a scene file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn

import numpy as np
import yaml

from msrr_scenes.checks.problems import KeyPath, dotted
from msrr_scenes.errors import SceneError, nearest
from msrr_scenes.loading.yaml_document import MAX_CHARACTERS, Dumper, YamlDocument, parse_value

#: Key that a text stands for where a mapping may be written as a text: ``as_built: careful`` is short for
#: ``as_built: {grade: careful}``, so that an override may give a key beside the grade.
SHORT_FORMS: Mapping[KeyPath, str] = {("as_built",): "grade"}

#: Mappings from names of bodies, and what these are: an override of a key of one that is not there is a slip.
NAMED: Mapping[KeyPath, str] = {("units",): "unit", ("obstacles",): "obstacle"}


def override_text(key: str, value: object) -> str:
    """Return the value of an override as YAML text: a text as it is, a value of Python as YAML writes it.

    Raises:
        SceneError: It is an object that YAML has no text for.
    """
    if isinstance(value, str):
        return value
    try:
        text = yaml.dump(
            _plain(value),
            Dumper=Dumper,
            default_flow_style=True,
            width=MAX_CHARACTERS,
            allow_unicode=True,
            sort_keys=False,
        )
    except yaml.YAMLError:
        found = f"an object of type {type(value).__name__}"
        if isinstance(value, type):
            found = f"a class, which is named by its import path: '{value.__module__}:{value.__qualname__}'"
        raise SceneError(
            f"{key}: expected a text, a number, true, false or null, or a list or a dict of these, "
            f"found {found}"
        ) from None
    except ValueError as error:  # a whole number of thousands of digits
        raise SceneError(f"{key}: {error}") from None
    return text.removesuffix("...\n").strip()


def _plain(value: object) -> object:
    """Return a value with numbers of Python in the place of those of NumPy, also within lists and dicts."""
    match value:
        case np.generic():
            return value.item()
        case dict():
            return {_plain(key): _plain(inner) for key, inner in value.items()}
        case list() | tuple():
            return [_plain(inner) for inner in value]
    return value


def apply_overrides(
    document: YamlDocument, overrides: Mapping[str, str], told_as: str | Mapping[str, str] = "override"
) -> None:
    """Write ``a.b.c=value`` pairs, of which the values are YAML text, into a document; lists take an index.

    Mappings that are missing are created, but for bodies: a new one is given as a whole. ``told_as`` is what
    messages call an override, or each of them by its key.

    Raises:
        SceneError: A value is no YAML that a scene file could hold, or a path leads through a plain value,
            past the end of a list or into a body that is not there.
    """
    given: list[str] = []
    names = dict.fromkeys(overrides, told_as) if isinstance(told_as, str) else told_as
    for key, text in overrides.items():
        option = f"{names[key]} {key}={text}"
        parts = key.split(".")
        lost = next((earlier for earlier in given if earlier.startswith(f"{key}.")), None)
        if lost is not None:
            raise SceneError(f"{option}: it would take back {names[lost]} {lost}; give {key} before {lost}")
        given.append(key)
        if not all(parts):
            raise SceneError(f"{option}: expected a dotted key such as cameras.onboard.noise_grey")
        _put(document, parts, parse_value(text, option), option)


def _put(document: YamlDocument, parts: list[str], value: Any, option: str) -> None:
    container: Any = document.data
    path: KeyPath = ()
    for depth, part in enumerate(parts):
        key: str | int = part
        if isinstance(container, list):
            if not part.isdecimal() or int(part) >= len(container):
                valid = f"0 .. {len(container) - 1}" if container else "none, it is empty"
                raise SceneError(
                    f"{option}: {dotted(path)} is a list; expected an index ({valid}), found {part!r}"
                )
            key = int(part)
        elif not isinstance(container, dict):
            raise SceneError(f"{option}: {dotted(path)} is a plain value and has no key {part!r}")
        path = (*path, key)
        if depth == len(parts) - 1:
            container[key] = value
        elif isinstance(container, dict) and container.get(key) is None:
            if path[:-1] in NAMED and key not in container:
                _refuse_name(str(key), container, NAMED[path[:-1]], option)
            container[key] = {}
            document.origins[path] = option
        elif path in SHORT_FORMS and isinstance(container[key], str):
            container[key] = {SHORT_FORMS[path]: container[key]}
        elif parts[depth + 1] == "params" and isinstance(container[key], str):
            container[key] = {"name": container[key]}  # the short form of a choice
        container = container[key]
    for old in [p for p in document.origins if p[: len(path)] == path]:
        del document.origins[old]
    document.origins[path] = option


def _refuse_name(name: str, known: Mapping[str, Any], kind: str, option: str) -> NoReturn:
    here = f"{kind.capitalize()}s here: {', '.join(known) or 'none'}"
    raise SceneError(
        f"{option}: there is no {kind} {name!r}{nearest(name, known)} {here}. A new one is given as a whole, "
        f"{kind}s.{name}={{...}}"
    )
