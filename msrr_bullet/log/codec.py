"""Frozen dataclasses to JSON and back, bit for bit.

Floats are written by ``repr``, the shortest text that reads back as the same double; numbers that JSON does
not know are the strings ``"NaN"``, ``"Infinity"`` and ``"-Infinity"`` (the convention of protobuf's JSON
mapping). Fields keep the order of their class. Equal messages therefore give equal bytes, and equal bytes
mean messages that are equal to the bit.

The codec of a class is derived from its type hints, so a new message type needs only annotations.

The schemas use the part of JSON Schema that Foxglove reads, which shows no topic whose schema has anything
else in it: one type for each field, and arrays of which all items have one type that is no array. Fields of
which that cannot be said are left out of the schema, as JSON Schema permits; readers find them in the
messages. A float is a number there, although NaN and the infinities are strings.
"""

from __future__ import annotations

import json
import math
import types
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
from typing import Any, Generic, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from msrr_bullet.log.records import ClearanceRecord
from msrr_scenes.arrays import Array, frozen
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import ArenaEstimate

T = TypeVar("T")

#: Value that ``json`` can write: dict, list, str, int, float, bool or None.
Json = Any

_compact = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False)

#: Names in logs of message classes that were renamed since the first logs were written. Logs keep the old
#: names, so that all of them can be read.
_LOG_NAMES: dict[type, str] = {ArenaEstimate: "Situation", ClearanceRecord: "Clearance"}


def log_name(kind: type) -> str:
    """Return the name of a message class in logs and in their schemas."""
    return _LOG_NAMES.get(kind, kind.__name__)


class LogError(MsrrError):
    """A log cannot be written or read."""


@dataclass(frozen=True, slots=True)
class Codec(Generic[T]):
    """Conversion of the values of one type to JSON and back.

    ``schema`` is the JSON Schema of the encoded value; None if the part that Foxglove reads cannot tell it.
    """

    encode: Callable[[T], Json]
    decode: Callable[[Json], T]
    schema: dict[str, Json] | None


def to_bytes(value: Json) -> bytes:
    """Return the compact JSON text of a value in UTF-8."""
    return _compact.encode(value).encode()


def number(x: float) -> float | str:
    """Return a float as the log writes it: a number, or a string for NaN and the infinities."""
    x = float(x)
    if math.isfinite(x):
        return x
    return "NaN" if math.isnan(x) else ("Infinity" if x > 0.0 else "-Infinity")


def _array_out(array: Array) -> Json:
    if array.dtype != np.float64 or array.size == 0:
        raise LogError(
            f"a log holds arrays of doubles, not empty; this is {array.dtype} of shape {array.shape}"
        )
    return array.tolist() if np.isfinite(array).all() else _nested(number, array.tolist())


def _nested(convert: Callable[[float], Json], values: Json) -> Json:
    return [_nested(convert, v) for v in values] if isinstance(values, list) else convert(values)


def _array_in(values: Json) -> Array:
    array: Array = np.array(values)
    if not array.ndim:
        raise TypeError(f"expected a list of numbers, found {values!r}")
    # NaN and the infinities are strings in the log.
    return frozen(array if array.dtype == np.float64 else np.array(_nested(float, values), dtype=np.float64))


_SCALARS: dict[Any, Codec[Any]] = {
    bool: Codec(bool, bool, {"type": "boolean"}),
    int: Codec(int, int, {"type": "integer"}),
    float: Codec(number, float, {"type": "number"}),
    str: Codec(str, str, {"type": "string"}),
}


@cache
def codec(kind: Any) -> Codec[Any]:
    """Return the codec of a type.

    Supported are scalars, enums, tuples, dictionaries with string keys, optional values, arrays of doubles,
    and dataclasses of these.

    Raises:
        TypeError: The type is not supported. This is a mistake in the message class, not in its data.
    """
    if kind in _SCALARS:
        return _SCALARS[kind]
    origin, args = get_origin(kind), get_args(kind)
    if origin is np.ndarray:
        return Codec(_array_out, _array_in, None)  # of any number of dimensions
    if origin is tuple:
        return _tuple_codec(args)
    if origin is dict and args[0] is str:
        inner = codec(args[1])
        return Codec(
            lambda value: {k: inner.encode(v) for k, v in value.items()},
            lambda value: {k: inner.decode(v) for k, v in value.items()},
            {"type": "object", "properties": {}, "additionalProperties": inner.schema or True},
        )
    if origin in (Union, types.UnionType) and len(args) == 2 and type(None) in args:
        inner = codec(args[0] if args[1] is type(None) else args[1])
        return Codec(
            lambda value: None if value is None else inner.encode(value),
            lambda value: None if value is None else inner.decode(value),
            None,
        )
    if isinstance(kind, type) and issubclass(kind, Enum):
        members = [m.value for m in kind]
        schema = {"type": "string" if isinstance(members[0], str) else "integer", "enum": members}
        return Codec(lambda value: value.value, kind, schema)
    if isinstance(kind, type) and is_dataclass(kind):
        return _dataclass_codec(kind)
    raise TypeError(f"{kind!r} has no JSON form in a log")


def _tuple_codec(args: tuple[Any, ...]) -> Codec[Any]:
    if len(args) == 2 and args[1] is Ellipsis:
        item = codec(args[0])
        return Codec(
            lambda values: [item.encode(v) for v in values],
            lambda values: tuple(item.decode(v) for v in values),
            _array_schema([item]),
        )
    items = tuple(codec(a) for a in args)
    return Codec(
        lambda values: [c.encode(v) for c, v in zip(items, values, strict=True)],
        lambda values: tuple(c.decode(v) for c, v in zip(items, values, strict=True)),
        _array_schema(items),
    )


def _array_schema(items: Sequence[Codec[Any]]) -> dict[str, Json] | None:
    """Return the schema of an array whose items have these codecs; None unless all are of one such type."""
    first = items[0].schema
    if first is None or first["type"] == "array" or any(item.schema != first for item in items):
        return None
    return {"type": "array", "items": first}


def _dataclass_codec(kind: type) -> Codec[Any]:
    hints = get_type_hints(kind)
    parts = [(f.name, codec(hints[f.name])) for f in fields(kind)]
    encoders = [(name, part.encode) for name, part in parts]
    decoders = [(name, part.decode) for name, part in parts]
    added = {f.name for f in fields(kind) if f.default is not MISSING}
    return Codec(
        lambda value: {name: encode(getattr(value, name)) for name, encode in encoders},
        # A field with a default may be missing: older versions did not know it.
        lambda value: kind(**{n: decode(value[n]) for n, decode in decoders if n in value or n not in added}),
        {
            "title": f"msrr.{log_name(kind)}",
            "type": "object",
            "properties": {name: part.schema for name, part in parts if part.schema is not None},
        },
    )
