"""The reference of all keys of a scene, from the schema by which editors check scene files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from code_reference import attribute_meanings
from markdown_text import cell, prose, table
from pydantic import BaseModel

from msrr_bullet.render.renderer_registry import RENDERERS
from msrr_control.docking.barrier import BarrierParams
from msrr_control.docking.c1 import C1DockingParams, LinearParams
from msrr_control.docking.c2 import C2DockingParams
from msrr_control.docking.controller import CONTROLLERS
from msrr_control.docking.graceful import GracefulParams
from msrr_control.staging.parameters import AssemblyParams, C2AssemblyParams
from msrr_control.staging.registry import ASSEMBLERS
from msrr_perception.detection.detector import DETECTORS
from msrr_perception.estimation.estimator import ESTIMATORS
from msrr_scenes.loading.file_schema import file_schema
from msrr_scenes.specs.control import ControlSpec
from msrr_scenes.specs.sensors import CameraSpec, OverheadCameraSpec
from msrr_scenes.specs.vehicle import LIMIT_SETTINGS

Schema = Mapping[str, Any]

#: Units by the end of a key, longest first.
UNITS = {
    "_mps2": "m/s²",
    "_radps2": "rad/s²",
    "_radps": "rad/s",
    "_per_s": "1/s",
    "_mps": "m/s",
    "_percent": "%",
    "_grey": "grey levels",
    "_deg": "deg",
    "_rad": "rad",
    "_hz": "Hz",
    "_ms": "ms",
    "_nm": "N m",
    "_px": "px",
    "_kg": "kg",
    "_m": "m",
    "_s": "s",
    "_n": "N",
}

#: Keys whose value names an implementation, and what is registered there.
EXTENSION_POINTS: Mapping[str, Mapping[str, Any]] = {
    "control.assembly": ASSEMBLERS,
    "control.docking": CONTROLLERS,
    "control.estimator": ESTIMATORS,
    "control.detector": DETECTORS,
    "cameras.onboard.renderer": RENDERERS,
    "cameras.overhead.renderer": RENDERERS,
}

#: Parameters of the registered laws, by the key that names the law and by its name.
PARAMETERS: Mapping[str, Mapping[str, type[BaseModel]]] = {
    "control.assembly": {"c1": AssemblyParams, "c2": C2AssemblyParams},
    "control.docking": {
        "c1": C1DockingParams,
        "c2": C2DockingParams,
        "cbf": BarrierParams,
        "graceful": GracefulParams,
        "linear": LinearParams,
    },
}

#: Signs of the bounds of a number, in the order in which they are written.
_BOUNDS = (("≥", "minimum"), (">", "exclusiveMinimum"), ("≤", "maximum"), ("<", "exclusiveMaximum"))

_COLUMNS = ("key", "type", "range", "default", "unit", "meaning")


@dataclass(frozen=True)
class Key:
    """One key: its dotted path, and its type, range, default, unit and meaning in words."""

    path: str
    type: str
    range: str
    default: str
    unit: str
    meaning: str

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        return (f"`{self.path}`", self.type, self.range, self.default, self.unit, cell(self.meaning))


def keys(schema: Schema, models: Mapping[str, Schema], prefix: str = "") -> Iterator[Key]:
    """Yield every key of a mapping, and of all that it holds.

    Args:
        schema: JSON schema of the mapping.
        models: Schemas that others refer to, by name.
        prefix: Dotted path of the mapping, with a full stop at its end.
    """
    for name, value in schema["properties"].items():
        path = f"{prefix}{name}"
        options = _options(value, models)
        default = "required" if name in schema.get("required", ()) else _default(value)
        description = value.get("description") or next(
            (option["description"] for option in options if option.get("description")), ""
        )
        if any("const" in option for option in options):  # the key that says which kind of mapping this is
            description = schema.get("description", description)
        yield _key(path, options, default, description)
        for option in options:
            yield from _inside(option, models, path)


def _key(path: str, options: Sequence[Schema], default: str, description: str) -> Key:
    kinds = dict.fromkeys(_kind(option) for option in options)
    ranges = dict.fromkeys(text for option in options if (text := _range(option)))
    return Key(path, " or ".join(kinds), ", ".join(ranges), default, _unit(path, description), description)


def _inside(schema: Schema, models: Mapping[str, Schema], path: str) -> Iterator[Key]:
    """Yield the keys inside a value: of a mapping, of the items of a list, and of named parts."""
    if _is_deviation(schema):
        return
    if "properties" in schema:
        yield from keys(schema, models, f"{path}.")
    for place, part in _parts(schema):
        for option in _options(part, models):
            yield from _inside(option, models, f"{path}.{place}")


def _parts(schema: Schema) -> Iterator[tuple[str, Schema]]:
    if isinstance(schema.get("items"), Mapping):
        yield "N", schema["items"]
    for value in schema.get("patternProperties", {}).values():
        yield "NAME", value


def _options(schema: Schema, models: Mapping[str, Schema]) -> list[Schema]:
    """Return the alternatives of a value, with all references followed; null is none of them."""
    if "$ref" in schema:
        return _options(models[schema["$ref"].rpartition("/")[2]], models)
    alternatives = schema.get("anyOf") or schema.get("oneOf")
    if alternatives is None:
        return [] if schema.get("type") == "null" else [schema]
    return [option for part in alternatives for option in _options(part, models)]


def _is_deviation(schema: Schema) -> bool:
    return set(schema.get("properties", ())) == {"sigma", "error"}


def _kind(schema: Schema) -> str:
    if "enum" in schema:
        return " or ".join(f"`{value}`" for value in schema["enum"])
    if "const" in schema:
        return f"`{schema['const']}`"
    if _is_deviation(schema):
        return "`{sigma, error}`"
    if "prefixItems" in schema:
        return f"{len(schema['prefixItems'])} numbers"
    return {"object": "mapping", "array": "list", "string": "text", "boolean": "`true` or `false`"}.get(
        schema["type"], schema["type"]
    )


def _range(schema: Schema) -> str:
    if _is_deviation(schema):
        return f"sigma {_range(schema['properties']['sigma'])}"
    if "prefixItems" in schema:
        return _range(schema["prefixItems"][0])
    bounds = [(sign, schema[word]) for sign, word in _BOUNDS if word in schema]
    if [sign for sign, _ in bounds] == ["≥", "≤"]:
        return f"{bounds[0][1]:g} .. {bounds[1][1]:g}"
    if bounds:
        return ", ".join(f"{sign} {value:g}" for sign, value in bounds)
    most = schema.get("maxItems") or schema.get("maxProperties")
    return f"at most {most}" if most else ""


def _default(schema: Schema) -> str:
    if "default" not in schema:
        return ""
    default = schema["default"]
    if default is None:
        return "none"
    if default in ([], ""):
        return "empty"
    if isinstance(default, list):
        return ", ".join(f"{value:g}" for value in default)
    if isinstance(default, bool):
        return str(default).lower()
    return f"{default:g}" if isinstance(default, float) else str(default)


def _unit(path: str, description: str) -> str:
    """Return the unit of a value: as its key ends, else as its description says in brackets."""
    for end, unit in UNITS.items():
        if path.endswith(end):
            return unit
    stated = re.search(r"\[(px|m|deg|rad|s|ms|1/s|%|m/s|N|Hz)\]", description)
    return stated[1] if stated else ""


def scene_keys() -> list[Key]:
    """Return all keys of a scene."""
    schema, filled_in = file_schema(), _filled_in()
    found = dict.fromkeys(keys(schema, schema["$defs"]))
    return [replace(key, default=filled_in.get(key.path, key.default)) for key in found]


def _filled_in() -> dict[str, str]:
    """Return the defaults that the schema leaves open: names of implementations, and limits by setting."""
    parts = {
        "control": ControlSpec(),
        "cameras.onboard": CameraSpec(),
        "cameras.overhead": OverheadCameraSpec(),
    }
    named = {path: path.rpartition(".") for path in EXTENSION_POINTS}
    return {path: getattr(parts[part], key).name for path, (part, _, key) in named.items()} | {
        f"limits.{limit}": ", ".join(f"{LIMIT_SETTINGS[name][limit]:g} ({name})" for name in LIMIT_SETTINGS)
        for limit in LIMIT_SETTINGS["normal"]
    }


def parameter_keys(values: BaseModel, prefix: str = "") -> Iterator[Key]:
    """Yield the parameters of a law.

    Their meanings are in the docstrings of the models that hold them.

    Args:
        values: Parameters with the values of their defaults.
        prefix: Dotted path of the mapping that holds them, with a full stop at its end.
    """
    kind = type(values)
    schema = kind.model_json_schema()
    models, meanings = schema.get("$defs", {}), attribute_meanings(kind)
    for name, value in schema["properties"].items():
        part, path = getattr(values, name), f"{prefix}{name}"
        nested = isinstance(part, BaseModel)
        default = "" if nested else _default({"default": part})
        yield _key(path, _options(value, models), default, meanings.get(name, ""))
        if nested:
            yield from parameter_keys(part, f"{path}.")


_HEAD = """\
# Keys of a scene

Every key that a scene file may hold, from the models that check it. `NAME` stands for a name that the scene
chooses, `N` for the place in a list, counted from 0. Written with full stops, as here, a key can be given on
the command line: `--set cameras.onboard.noise_grey=8`.

A value of type `{sigma, error}` is a [deviation from the drawing](../explanation/as_built.md). A number alone
is the true error, which no robot knows; `sigma` is the standard deviation, which robots may know. The first
range is that of the error.

How the parts of a scene go together is told in [Scene files](scene_files.md).
"""


def keys_page() -> str:
    """Return the page of all keys."""
    sections: dict[str, list[Key]] = {}
    everything = scene_keys()
    parents = {key.path.partition(".")[0] for key in everything if "." in key.path}
    for key in everything:
        top = key.path.partition(".")[0]
        sections.setdefault(top if top in parents else "", []).append(key)
    text = _HEAD + "\n## The scene as a whole\n\n" + table(_COLUMNS, (key.cells for key in sections.pop("")))
    schema = file_schema()
    for top, found in sections.items():
        described = _options(schema["properties"][top], schema["$defs"])
        about = next((option["description"] for option in described if option.get("description")), "")
        text += f"\n## {top}\n\n{prose(about)}\n\n" + table(_COLUMNS, (key.cells for key in found))
        text += "".join(_extension_point(path) for path in EXTENSION_POINTS if path.startswith(f"{top}."))
    return text


def _extension_point(path: str) -> str:
    """Return what may be named at an extension point, and the parameters of the laws there."""
    names = ", ".join(f"`{name}`" for name in EXTENSION_POINTS[path])
    text = f"\n### Registered for `{path}`\n\n{names}, or the import path of a class of your own.\n"
    for name, kind in PARAMETERS.get(path, {}).items():
        rows = (key.cells for key in parameter_keys(kind()))
        text += f"\n#### Parameters of `{name}` for `{path}`\n\n{table(_COLUMNS, rows)}"
    return text
