"""JSON schemas of the files that people write, by which editors complete and check them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from msrr_scenes.errors import UnknownNameError
from msrr_scenes.specs.as_built import GRADES
from msrr_scenes.specs.deviations import Deviation
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Spec
from msrr_scenes.specs.tag_map import TagMapSpec
from msrr_scenes.specs.target import TargetSpec

Schema = dict[str, Any]

#: Version of JSON Schema that pydantic writes.
_DIALECT = "https://json-schema.org/draft/2020-12/schema"

#: Models that a file may also write as a text or a number, with the schema of that. They are the short forms
#: that the validators of these models read.
_SHORT_FORMS: Mapping[str, Schema] = {
    "Choice": {"type": "string", "minLength": 1, "maxLength": 255},
    "AsBuiltSpec": {"enum": list(GRADES)},
    "AssembledPair": {"type": "string", "pattern": r"^[a-z]\w*\.[a-z]\w*-[a-z]\w*\.[a-z]\w*$"},
    "CalibrationSpec": {"type": "string", "minLength": 1},
    "FrameSpec": {"type": "string", "minLength": 1, "maxLength": 255},
    "MarkerSpec": {"type": "string", "minLength": 1},
    "TagMapSpec": {"type": "string", "minLength": 1},
}

#: Models whose keys are all filled in by a validator.
_FILLED_IN = frozenset({"Choice", "LimitsSpec"})


def file_schema(kind: str = "scene") -> Schema:
    """Return the JSON schema (draft 2020-12) of a kind of file, one of :data:`KINDS`.

    It accepts every file that is read without an error, but for numbers that YAML takes for texts. What only
    several values together make wrong (two bodies in one place, a port that no unit has) passes it;
    ``msrr check`` finds that.

    Raises:
        UnknownNameError: There is no such kind of file.
    """
    if kind not in KINDS:
        raise UnknownNameError("kind of file", kind, KINDS)
    return {"$schema": _DIALECT, **_without_noise(KINDS[kind]())}


def _written_schema(model: type[Spec]) -> Schema:
    """Return the schema of a model, with the short forms in which a file may write its parts."""
    schema = model.model_json_schema()
    models = schema["$defs"]
    for name in models.keys() & _FILLED_IN:
        del models[name]["required"]
    short_forms = {**_SHORT_FORMS, **{kind.__name__: _error_of(kind) for kind in _kinds_of(Deviation)}}
    for name, short in short_forms.items():
        if name in models:
            models[name] = _either(short, models[name])
    return schema


def _scene_schema() -> Schema:
    schema = _written_schema(Scene)
    keys = schema["properties"]
    del keys["source"]  # it is set by the program
    schema["required"].remove("name")  # it is that of the file
    several = next(option for option in keys["shape"]["anyOf"] if option["type"] != "null")
    keys["shape"]["anyOf"].insert(0, several["items"])
    return {**schema, "description": "A scene of msrr-bullet."}


def _target_schema() -> Schema:
    either = [{"required": ["unit"]}, {"required": ["marker"]}]
    return {**_written_schema(TargetSpec), "oneOf": either, "description": "The target of a recording."}


def _tag_map_schema() -> Schema:
    return TagMapSpec.model_json_schema()


#: The kinds of files.
KINDS: Mapping[str, Callable[[], Schema]] = {
    "scene": _scene_schema,
    "tag_map": _tag_map_schema,
    "target": _target_schema,
}


def _kinds_of(model: type[Spec]) -> list[type[Spec]]:
    """Return a model and all that are derived from it."""
    return [model, *(kind for child in model.__subclasses__() for kind in _kinds_of(child))]


def _error_of(deviation: type[Spec]) -> Schema:
    """Return the schema of the true error of a deviation, which a file may write alone."""
    options: list[Schema] = deviation.model_json_schema()["properties"]["error"]["anyOf"]
    return next(option for option in options if option["type"] == "number")


def _either(short: Schema, model: Schema) -> Schema:
    """Return the schema of a model that may be written in a short form."""
    return {"description": model.get("description", ""), "anyOf": [short, model]}


def _without_noise(schema: Any, *, named: bool = False) -> Any:
    """Return a schema without titles, without defaults that its parts say again, and with closed mappings.

    If ``named``, the keys of the schema or part of one are names of the file, and no words of JSON Schema.
    """
    if isinstance(schema, list):
        return [_without_noise(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    if named:
        return {key: _without_noise(value) for key, value in schema.items()}
    kept = {
        key: value if key == "default" else _without_noise(value, named=key in ("properties", "$defs"))
        for key, value in schema.items()
        if key != "title" and not (key == "default" and isinstance(value, dict))
    }
    if "patternProperties" in kept:
        kept.setdefault("additionalProperties", False)
    return kept
