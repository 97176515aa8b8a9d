"""The reference of all public modules, classes and functions, from their docstrings."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import griffe
from markdown_text import cell, prose, table

ROOT = Path(__file__).resolve().parents[2]

#: Import name of each package -> the folder it is in.
PACKAGES = {
    "msrr_scenes": ROOT / "scenes",
    "msrr_perception": ROOT / "perception",
    "msrr_control": ROOT / "control",
    "msrr_bullet": ROOT,
}


@cache
def load(package: str) -> griffe.Module:
    """Return a package as it is written; nothing of it is run."""
    loaded = griffe.load(
        package,
        search_paths=[PACKAGES[package]],
        docstring_parser="google",
        # A text of several lines is one value.
        docstring_options={"returns_multiple_items": False, "returns_named_value": False},
        allow_inspection=False,
    )
    assert isinstance(loaded, griffe.Module)
    return loaded


def public(parent: griffe.Module | griffe.Class) -> Iterator[Any]:
    """Yield the public modules, classes and functions that are defined in a module or a class."""
    for name, member in parent.members.items():
        if not name.startswith("_") and not member.is_alias and not member.is_attribute:
            yield member


def undocumented() -> list[str]:
    """Return the paths of all public code, and of all values of messages, without a docstring."""
    missing = []
    pending: list[Any] = [load(package) for package in PACKAGES]
    while pending:
        thing = pending.pop()
        if not thing.has_docstring and not _overrides(thing):
            missing.append(thing.path)
        if thing.is_module or thing.is_class:
            pending += public(thing)
        if thing.is_class and _is_enum(thing) and thing.path.startswith("msrr_scenes."):
            pending += [m for m in thing.members.values() if m.is_attribute and m.name.isupper()]
    return sorted(missing)


def attribute_meanings(kind: type) -> dict[str, str]:
    """Return what the docstrings of a class and of those that it is derived from say of its attributes."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        text = inspect.cleandoc(base.__doc__ or "") if base.__module__.startswith("msrr_") else ""
        for section in griffe.Docstring(text, parser="google").parsed:
            if section.kind is griffe.DocstringSectionKind.attributes:
                found |= {item.name: item.description for item in section.value}
    return found


def _overrides(thing: Any) -> bool:
    decorators = getattr(thing, "decorators", ())
    return any(str(decorator.value) == "override" for decorator in decorators)


def _is_enum(kind: griffe.Class) -> bool:
    return any(str(base) == "Enum" for base in kind.bases)


def pages() -> dict[str, str]:
    """Return the pages by their paths below ``reference/code``: one for each sub-package."""
    written: dict[str, str] = {}
    for name in PACKAGES:
        package = load(name)
        modules = sorted((m for m in public(package) if m.is_module), key=lambda m: str(m.name))
        parts = [module for module in modules if module.is_init_module]
        for part in parts:
            text = f"# `{part.path}`\n\n{_text(part)}\n"
            written[f"{name}/{part.name}.md"] = text + "".join(map(_module, _modules(part)))
        rows = [(f"[`{part.path}`]({part.name}.md)", cell(_summary(part))) for part in parts]
        text = f"# `{name}`\n\n{_text(package)}\n\n{table(('package', 'purpose'), rows)}"
        written[f"{name}/index.md"] = text + "".join(_module(m) for m in modules if m not in parts)
    return written


def _modules(package: griffe.Module) -> Iterator[griffe.Module]:
    """Yield the modules in a package at any depth, and the package itself where it defines something."""
    if any(not member.is_module for member in public(package)):
        yield package
    for member in sorted((m for m in public(package) if m.is_module), key=lambda m: str(m.path)):
        if member.is_init_module:
            yield from _modules(member)
        else:
            yield member


def _module(module: griffe.Module) -> str:
    members = [member for member in public(module) if not member.is_module]
    shown = (class_text(m) if m.is_class else _function(m, "###") for m in members)
    return f"\n## `{module.path}`\n\n{_text(module)}\n" + "".join(shown)


def class_text(kind: Any) -> str:
    """Return the section of a class."""
    bases = ", ".join(str(base) for base in kind.bases)
    text = f"\n### class `{kind.name}{f'({bases})' if bases else ''}`\n\n{_text(kind, but='attributes')}\n"
    if _is_enum(kind):
        return text + f"\n{values_table(kind)}"
    sections = [s for s in kind.docstring.parsed if s.kind.value == "attributes"] if kind.docstring else []
    said = {item.name: item.description for section in sections for item in section.value}
    rows = [
        (f"`{m.name}`", _type(m.annotation), cell(said.get(m.name) or _summary(m)))
        for m in kind.members.values()
        if m.is_attribute and not m.name.startswith("_") and (m.annotation or m.name in said)
    ]
    columns = (
        ("attribute", "type", "meaning") if any(meaning for *_, meaning in rows) else ("attribute", "type")
    )
    if rows:
        text += "\n" + table(columns, [row[: len(columns)] for row in rows])
    return text + "".join(_function(member, "####") for member in public(kind) if member.is_function)


def _type(annotation: Any) -> str:
    """Return the type of an attribute as a cell; empty if the code does not say it."""
    return f"`{annotation}`" if annotation else ""


def values_table(kind: Any) -> str:
    """Return the values of an enumeration as a table."""
    rows = [(f"`{value}`", meaning) for value, meaning in enum_values(kind).items()]
    return table(("value", "meaning"), rows)


def enum_values(kind: Any) -> dict[str, str]:
    """Return the values of an enumeration with their meanings, each as a cell of a table."""
    members = (m for m in kind.members.values() if m.is_attribute and m.name.isupper())
    return {str(ast.literal_eval(str(m.value))): cell(_summary(m)) for m in members}


def _function(function: Any, heading: str) -> str:
    parameters = [p for p in function.parameters if p.name not in ("self", "cls")]
    shown = ", ".join(_parameter(parameter) for parameter in parameters)
    returned = f" -> {function.returns}" if function.returns else ""
    signature = f"{function.name}({shown}){returned}"
    return f"\n{heading} `{function.name}`\n\n```text\n{signature}\n```\n\n{_text(function)}\n"


def _parameter(parameter: Any) -> str:
    stars = {"variadic positional": "*", "variadic keyword": "**"}.get(parameter.kind.value, "")
    annotated = f": {parameter.annotation}" if parameter.annotation else ""
    default = f" = {parameter.default}" if parameter.default is not None and not stars else ""
    return f"{stars}{parameter.name}{annotated}{default}"


def _summary(thing: Any) -> str:
    return thing.docstring.value.partition("\n\n")[0] if thing.docstring else ""


def _text(thing: Any, but: str = "") -> str:
    """Return a docstring as Markdown, its text and its sections as lists, but for sections of one kind."""
    if not thing.docstring:
        return ""
    return "\n\n".join(_section(s) for s in thing.docstring.parsed if s.kind.value != but)


_TITLES = {"parameters": "Arguments", "other parameters": "Arguments"}


def _section(section: Any) -> str:
    kind = section.kind.value
    if kind == "text":
        return prose(section.value)
    if kind == "admonition":
        return f"**{section.title}** {prose(section.value.description)}"
    if not isinstance(section.value, list):
        return f"```python\n{section.value}\n```"
    lines = [_item(item) for item in section.value]
    return f"**{_TITLES.get(kind, kind.capitalize())}**\n\n" + "\n".join(lines)


def _item(item: Any) -> str:
    annotation = getattr(item, "annotation", None)
    name = getattr(item, "name", "") or annotation
    if name is annotation and isinstance(name, str):  # no type, but a text that holds a colon
        return f"- {cell(f'{name}: {item.description}')}"
    named = f"`{name}`: " if name else ""
    return f"- {named}{cell(item.description)}"
