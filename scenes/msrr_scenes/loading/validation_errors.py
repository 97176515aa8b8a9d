"""Translation of pydantic's validation errors into problems for the author of a scene file."""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from msrr_scenes.checks.problems import KeyPath, Problem
from msrr_scenes.errors import DECIMAL_POINT, nearest, nearest_key
from msrr_scenes.loading.yaml_document import YamlDocument
from msrr_scenes.specs.plan import DockStep, MoveStep, UndockStep

#: What a text has to be, by its key; pydantic gives the ports of ``shape.tree`` another one.
_PATTERNS = {
    "to": "'<unit>.<port>'",
    "active": "'<unit>.<port>'",
    "passive": "'<unit>.<port>'",
    "constrained-str": "'root' or '<place>.<port>'",
    "frame": "'world' or '<unit>.<port>'",
    "name": "a plain name of letters, digits, '.', '_' and '-', which is no path and has at most 64 of them",
}
_NAME = "a name of at most 32 lower-case letters, digits and underscores that starts with a letter"
#: Tags of the models of a union that is told apart by a function.
_TAGS: Mapping[type[BaseModel], str] = {DockStep: "dock", UndockStep: "undock", MoveStep: "move"}
#: Largest number of places of a key that are named where it is none.
_MOST_PLACES = 5
_NOT_KEYS = {"source"}  # fields that the program fills in
#: Likeness to a key that is there, from which an unknown key is taken for a misspelling of it even if it is a
#: key elsewhere.
_MISSPELT = 0.8


def explain(error: ErrorDetails, document: YamlDocument, root: type[BaseModel]) -> Problem | None:
    """Return the problem that one pydantic error stands for; None if the error only repeats another one.

    ``root`` is the model of the whole document.
    """
    kind, loc, given = error["type"], error["loc"], error["input"]
    path = _written_path(loc, document.data)
    found = _shown(given)
    context = error.get("ctx", {})
    if kind == "extra_forbidden":
        keys = _keys_at(root, loc[:-1])
        parent = _written_path(loc[:-1], document.data)
        return Problem(
            path, f"unknown key{_meant(str(loc[-1]), keys, root, loc[:-1], parent)}{_keys_here(keys)[1:]}"
        )
    if kind == "missing":
        return Problem((*path, str(loc[-1])), "required, and missing", rank=1)
    if kind == "flag":
        return Problem(
            (*path, context["key"]), _no_flag(_type_at(root, (*loc, context["key"])), context["shown"])
        )
    if kind == "too_short":
        # pydantic counts the items that passed: a list whose only item is wrong is "too short" as well.
        enough = len(given) >= context["min_length"]
        return (
            None
            if enough
            else Problem(path, f"expected at least {context['min_length']} entry, found {found}")
        )
    if kind == "too_long":
        point = DECIMAL_POINT if len(given) == 2 * context["max_length"] else ""
        return Problem(path, f"expected at most {context['max_length']} entries, found {len(given)}{point}")
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _wrong_tag((*path, context["discriminator"].strip("'")), _tags(root, loc), context.get("tag"))
    if kind == "literal_error":
        if loc[-1] == "literal['root']":
            return None  # the error of the port says it
        valid = [part.strip("'") for part in context["expected"].replace(" or ", ", ").split(", ")]
        return Problem(path, f"expected {context['expected']}, found {found}{nearest(given, valid)}")
    if kind == "string_pattern_mismatch":
        return Problem(path, f"expected {_PATTERNS.get(str(loc[-1]), _NAME)}, found {found}")
    point = DECIMAL_POINT if isinstance(given, str) and re.fullmatch(r"[+-]?\d+,\d+", given) else ""
    return Problem(path, _plainly(error["msg"], found, _keys_here(_keys_at(root, loc))) + point)


def _keys_here(keys: list[str]) -> str:
    return f". Keys here: {', '.join(keys)}" if keys else ""


def _wrong_tag(path: KeyPath, tags: list[str], tag: str | None) -> Problem:
    valid = " or ".join(repr(t) for t in tags)
    if tag is None:
        return Problem(path, f"required, and missing; expected {valid}")
    return Problem(path, f"expected {valid}, found {_shown(tag)}{nearest(tag, tags)}")


def _no_flag(annotation: Any, shown: str) -> str:
    """Return what is wrong with the flag ``shown`` where ``annotation`` is expected."""
    models = [member for member in _members(annotation) if _is_model(member)]
    if not models:
        return f"expected a value, found the flag {shown}; yes, no, on and off are flags unless quoted"
    mend = f"{{enabled: {shown}}}" if "enabled" in models[0].model_fields else "{} for the defaults"
    return f"expected keys with values, found the flag {shown}; write {mend}"


def _plainly(message: str, found: str, here: str) -> str:
    """Rewrite pydantic's ``Input should be ...``; other messages stay as they are.

    ``here`` is a sentence about the keys that are expected.
    """
    if message.startswith("Value error, "):
        return message.removeprefix("Value error, ")
    head, _, _ = message.partition(", ")
    if head.endswith("Deviation"):
        return f"expected a number, or the keys sigma and error, found {found}"
    if head.endswith("valid tuple") and found.startswith("'"):
        return f"expected a list, found {found}; a list of one is [{found[1:-1]}]"
    if "valid dictionary" in head:
        return f"expected keys with values, found {found}{here}"
    if head.startswith("Input should be "):
        wanted = head.removeprefix("Input should be ").replace("a valid tuple", "a list")
        bound = "a number " if wanted.startswith(("greater", "less")) else ""
        wanted = wanted.replace("valid ", "").replace("a integer", "an integer")
        return f"expected {bound}{wanted}, found {found}"
    if head.startswith("String should have "):
        return f"expected a text of {head.removeprefix('String should have ')}, found {found}"
    return f"{message[0].lower()}{message[1:]} (found {found})"


def _shown(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, Mapping):
        return "keys with values" if value else "none"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"a list of {len(value)}" if value else "none"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _written_path(loc: tuple[int | str, ...], data: Any) -> KeyPath:
    """Return a pydantic location without the tags of unions, which are not part of the document.

    A tag may be a key there, too: the step ``{move: a, pose: {}}`` has the tag ``move``. It is a key where it
    leads on or is the last part. Any other key counts with a text as well, which is short for a mapping:
    ``as_built: careful`` has the location ``("as_built", "grade")``.
    """
    path: KeyPath = ()
    for k, part in enumerate(loc):
        in_list = isinstance(data, list) and isinstance(part, int) and part < len(data)
        in_dict = isinstance(data, dict) and part in data
        if in_dict and part in _TAGS.values() and k + 1 < len(loc):
            in_dict = isinstance(data[part], (dict, list))
        if in_dict or in_list:
            data = data[part]
            path = (*path, part)
    return path


def _members(annotation: Any) -> list[Any]:
    """Return the types that an annotation allows, None aside."""
    origin = typing.get_origin(annotation)
    if origin is typing.Annotated:
        return _members(typing.get_args(annotation)[0])
    if origin in (typing.Union, types.UnionType):
        return [m for a in typing.get_args(annotation) if a is not type(None) for m in _members(a)]
    return [annotation]


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _literals(model: Any) -> list[str]:
    """Return the values of a model's first Literal field: the tags by which a union selects the model."""
    for field in model.model_fields.values():
        if typing.get_origin(field.annotation) is typing.Literal:
            return [str(v) for v in typing.get_args(field.annotation)]
    return []


def _step(annotation: Any, part: int | str) -> Any:
    """Follow one component of a pydantic location through the types; None if it leads nowhere."""
    members = _members(annotation)
    if len(members) > 1:
        return next((m for m in members if _is_model(m) and part in (*_literals(m), _TAGS.get(m))), None)
    only, args = members[0], typing.get_args(members[0])
    if _is_model(only):
        field = only.model_fields.get(str(part))
        return field.annotation if field else None
    if typing.get_origin(only) is dict:
        return args[1]
    if typing.get_origin(only) is tuple:
        return args[0]
    return None


def _type_at(root: type[BaseModel], loc: tuple[int | str, ...]) -> Any:
    annotation: Any = root
    for part in loc:
        annotation = None if annotation is None else _step(annotation, part)
    return annotation


def _keys_at(root: type[BaseModel], loc: tuple[int | str, ...]) -> list[str]:
    model: Any = _members(_type_at(root, loc))[0]
    return [k for k in model.model_fields if k not in _NOT_KEYS] if _is_model(model) else []


def _meant(
    key: str, keys: list[str], root: type[BaseModel], loc: tuple[int | str, ...], parent: KeyPath
) -> str:
    """Return what an unknown key may stand for, as the end of a sentence.

    That is a key that is there and much like it, what it is a key of, or a key that is there and a little
    like it. ``loc`` is pydantic's location of the keys that are there, ``parent`` that in the document.
    """
    name, colon, value = key.partition(":")
    if colon and name in keys:
        return f"; a space is missing behind the colon, as in `{name}: {value}`."
    misspelt = nearest_key(key, keys, _MISSPELT)
    if misspelt != ".":
        return misspelt
    others = [other for other in _alternatives(root, loc) if key in other.model_fields]
    if others:
        have, here = " or ".join(map(_told_apart_by, others)), _told_apart_by(_type_at(root, loc))
        return f"; it is a key of entries that have {have}, and not of those that have {here}."
    places = sorted({place for place in _places_of(key, root) if not _matches(place, parent)})
    below = [place for place in places if place]
    if not places or len(below) > _MOST_PLACES:
        return nearest_key(key, keys)
    parts = ["at the top of the file"] if "" in places else []
    if below:
        parts.append(f"below {', '.join(below[:-1])}{' or ' if len(below) > 1 else ''}{below[-1]}")
    return f"; it belongs {', or '.join(parts)}."


def _alternatives(root: type[BaseModel], loc: tuple[int | str, ...]) -> list[type[BaseModel]]:
    """Return the models of the union of which the one at a location of pydantic was chosen by its tag."""
    members = [each for each in _members(_type_at(root, loc[:-1])) if _is_model(each)] if loc else []
    return members if len(members) > 1 else []


def _told_apart_by(model: type[BaseModel]) -> str:
    """Return the keys that tell a model of a union from the others."""
    for name, field in model.model_fields.items():
        if typing.get_origin(field.annotation) is typing.Literal:
            return f"{name}: {' or '.join(map(str, typing.get_args(field.annotation)))}"
    return " and ".join(name for name, field in model.model_fields.items() if field.is_required())


def _matches(place: str, path: KeyPath) -> bool:
    """Return whether a dotted path, in which ``*`` stands for any name or number, is that of a mapping."""
    parts = place.split(".") if place else []
    return len(parts) == len(path) and all(p in ("*", str(q)) for p, q in zip(parts, path, strict=True))


def _places_of(key: str, annotation: Any, at: str = "") -> Iterator[str]:
    """Yield the parts of a document that have a key, as dotted paths; names and numbers in them are ``*``.

    The path of the whole document is empty.
    """
    for member in _members(annotation):
        arguments = {dict: slice(1, 2), tuple: slice(0, 1)}.get(typing.get_origin(member))
        if arguments is not None:
            for inner in typing.get_args(member)[arguments]:
                yield from _places_of(key, inner, f"{at}.*")
        elif _is_model(member):
            if key in member.model_fields:
                yield at
            for name, field in member.model_fields.items():
                yield from _places_of(key, field.annotation, f"{at}.{name}".lstrip("."))


def _tags(root: type[BaseModel], loc: tuple[int | str, ...]) -> list[str]:
    return [tag for m in _members(_type_at(root, loc)) if _is_model(m) for tag in _literals(m)]
