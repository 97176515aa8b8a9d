"""The parameters that a scene gives to a law, checked with messages for the author of the scene."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from msrr_scenes.errors import ParameterError, nearest_key
from msrr_scenes.specs.spec import Spec

P = TypeVar("P", bound=Spec)


def read_params(kind: type[P], params: dict[str, Any]) -> P:
    """Validate the parameters of a controller or an assembler, as the scene gives them.

    Raises:
        ParameterError: Parameters are wrong; it says of each what is wrong and the nearest valid name.
    """
    try:
        return kind.model_validate(params)
    except ValidationError as error:
        faults = {".".join(map(str, fault["loc"])): _explain(fault, kind) for fault in error.errors()}
        raise ParameterError(faults) from error


def _explain(fault: ErrorDetails, kind: type[Spec]) -> str:
    if fault["type"] == "extra_forbidden":
        keys = _keys_beside(fault["loc"], kind)
        return f"unknown parameter{nearest_key(fault['loc'][-1], keys)} Parameters here: {', '.join(keys)}"
    message = fault["msg"].removeprefix("Value error, ")
    return message if fault["type"] == "value_error" else f"{message}, found {fault['input']!r}"


def _keys_beside(loc: tuple[int | str, ...], kind: type[BaseModel]) -> list[str]:
    """Return the fields of the model that holds the last component of a location."""
    for part in loc[:-1]:
        annotation = kind.model_fields[str(part)].annotation
        if not (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
            return []
        kind = annotation
    return list(kind.model_fields)
