"""Every number that a scene can hold has a lower and an upper bound, every text and list a largest length."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest

import msrr_control
import msrr_scenes.specs
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Spec

#: Set by the program, and refused in a scene file.
NOT_IN_FILES = {("Scene", "source")}


def specs() -> list[type[Spec]]:
    packages: tuple[ModuleType, ...] = (msrr_scenes.specs, msrr_control)
    for package in packages:
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    pending, found = [Spec], []
    while pending:
        kinds = pending.pop().__subclasses__()
        found += [kind for kind in kinds if kind.__module__.startswith(("msrr_scenes", "msrr_control"))]
        pending += kinds
    return sorted(set(found), key=lambda kind: f"{kind.__module__}.{kind.__name__}")


def schemas(schema: Any) -> Iterator[dict[str, Any]]:
    """Yield the schema of a value and of all that it is made of, but for specifications of their own."""
    if isinstance(schema, dict):
        yield schema
        for part in (*schema.get("anyOf", ()), *schema.get("prefixItems", ()), schema.get("items")):
            yield from schemas(part)
        yield from schemas(schema.get("additionalProperties"))


def unbounded(schema: dict[str, Any]) -> bool:
    match schema.get("type"):
        case "number" | "integer":
            low, high = {"minimum", "exclusiveMinimum"}, {"maximum", "exclusiveMaximum"}
            return not (low & schema.keys() and high & schema.keys())
        case "string":
            return not {"maxLength", "pattern", "const", "enum"} & schema.keys()
        case "array":
            return "maxItems" not in schema
        case "object":
            return "maxProperties" not in schema
    return False


@pytest.mark.parametrize("kind", specs(), ids=lambda kind: f"{kind.__module__}.{kind.__name__}")
def test_every_number_text_and_list_of_a_specification_is_bounded(kind: type[Spec]) -> None:
    for key, value in kind.model_json_schema()["properties"].items():
        if (kind.__name__, key) not in NOT_IN_FILES:
            assert not [part for part in schemas(value) if unbounded(part)], key


def test_there_are_specifications_to_look_at() -> None:
    assert len(specs()) > 50
    assert Scene in specs()
