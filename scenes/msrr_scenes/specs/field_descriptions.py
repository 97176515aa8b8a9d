"""The descriptions of the keys of specifications, from the docstrings below their fields.

Pydantic would read them when a class is made, which takes every start of the program a tenth of a second.
"""

from __future__ import annotations

import ast
import inspect
import sys
from functools import cache
from itertools import zip_longest

from pydantic import BaseModel


@cache
def field_descriptions(kind: type[BaseModel]) -> dict[str, str]:
    """Return what the fields of a model are, by name, inherited ones included.

    A class whose source cannot be read, as one that was typed in, describes none of its own.
    """
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if issubclass(base, BaseModel) and base is not BaseModel:
            found |= _own_docstrings(base)
    return {name: text for name, text in found.items() if text and name in kind.model_fields}


def _own_docstrings(kind: type) -> dict[str, str]:
    """Return the docstrings below the annotations in the body of a class; empty where there is none."""
    body = _classes(kind.__module__).get(kind.__qualname__, [])
    return {
        field.target.id: _text(below)
        for field, below in zip_longest(body, body[1:])
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
    }


def _text(statement: ast.stmt | None) -> str:
    """Return the text of a statement that is nothing but a text, else none."""
    match statement:
        case ast.Expr(value=ast.Constant(value=str() as text)):
            return inspect.cleandoc(text)
    return ""


@cache
def _classes(module: str) -> dict[str, list[ast.stmt]]:
    """Return the bodies of the classes of a module, by name."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (KeyError, OSError, TypeError):  # typed in, or without a file
        return {}
    return {node.name: node.body for node in tree.body if isinstance(node, ast.ClassDef)}
