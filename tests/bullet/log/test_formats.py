"""Every message class can be logged, and comes back equal to the bit."""

from __future__ import annotations

import base64
import dataclasses
import json
import math
import re
import types
import typing
from enum import Enum
from functools import cache

import cv2
import jsonschema
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import msrr_scenes.messages as messages
from msrr_bullet.log import CameraWindow, LogError
from msrr_bullet.log.codec import log_name, to_bytes
from msrr_bullet.log.formats import format_named, format_of, message_types
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Exposure
from tests.bullet.log.conftest import bits

#: The pixels of a window are in a frame, by which a reader gives them back.
WITHOUT_PIXELS = [kind for kind in message_types() if kind is not CameraWindow]

FLOATS = st.floats(allow_nan=True, allow_infinity=True).map(lambda x: math.nan if math.isnan(x) else x)
METRES = st.floats(-1e3, 1e3)
SHAPES = {
    "corners": (4, 2),
    "covariance": (3, 3),
    "shared": (3, 3),
    "nearest": (2, 3),
    "corner_sigma_px": (4,),
}


@cache  # hypothesis looks at a strategy for as long as a message takes to draw
def strategy(kind: typing.Any, name: str = "") -> st.SearchStrategy[typing.Any]:
    """Any value of a message's field, from its type: a new message is tested without a new line here."""
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if kind is bool:
        return st.booleans()
    if kind is int:
        return st.integers(0, 2**62)
    if kind is float:
        return FLOATS
    if kind is str:
        # What a number that JSON does not know is written as is no name of anything here.
        return st.text(max_size=20).filter(lambda text: text not in ("NaN", "Infinity", "-Infinity"))
    if kind is SE2:
        return st.builds(SE2, FLOATS, FLOATS, st.floats(-math.pi, math.pi))
    if kind is SE3:
        return st.builds(SE3.from_xyz_rpy, st.tuples(*[METRES] * 3), st.tuples(*[METRES] * 3))
    if origin is np.ndarray:
        return arrays(np.float64, SHAPES[name], elements=FLOATS)
    if origin is tuple and args[-1] is Ellipsis:
        return st.lists(strategy(args[0], name), max_size=3).map(tuple)
    if origin is tuple:
        return st.tuples(*(strategy(a, name) for a in args))
    if origin is dict:
        return st.dictionaries(st.text(max_size=5), strategy(args[1]), max_size=3)
    if origin in (typing.Union, types.UnionType):
        return st.one_of(*(st.none() if a is type(None) else strategy(a, name) for a in args))
    if isinstance(kind, type) and issubclass(kind, Enum):
        return st.sampled_from(kind)
    hints = typing.get_type_hints(kind)
    return st.builds(kind, **{f.name: strategy(hints[f.name], f.name) for f in dataclasses.fields(kind)})


@pytest.mark.parametrize("kind", WITHOUT_PIXELS, ids=lambda kind: kind.__name__)
@settings(max_examples=10, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_every_message_comes_back_bit_for_bit(kind: type, data: st.DataObject) -> None:
    message = data.draw(strategy(kind))
    message_format = format_of(message)
    text = to_bytes(message_format.encode(message))
    back = message_format.decode(json.loads(text))
    assert bits(back) == bits(message)
    assert to_bytes(message_format.encode(back)) == text
    json.loads(text, parse_constant=pytest.fail)  # strict JSON, readable by any viewer


def assert_foxglove_reads(schema: dict[str, typing.Any], name: str) -> None:
    """Assert that Foxglove shows messages of a schema; it drops topics whose schema has anything else in it.

    Source: parseJsonSchema of Foxglove Studio and of Lichtblick.
    """
    assert schema["type"] == "object", name
    for field, value in schema["properties"].items():
        items = value["items"] if value["type"] == "array" else value
        assert items["type"] in ("boolean", "string", "number", "integer", "object"), f"{name}.{field}"
        if items["type"] == "object":
            assert_foxglove_reads(items, f"{name}.{field}")


@pytest.mark.parametrize("kind", message_types(), ids=lambda kind: kind.__name__)
def test_foxglove_reads_the_schema_of_every_message(kind: type) -> None:
    assert_foxglove_reads(format_named(log_name(kind)).schema, kind.__name__)


@pytest.mark.parametrize("kind", WITHOUT_PIXELS, ids=lambda kind: kind.__name__)
@settings(max_examples=6, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_every_message_is_as_its_schema_says(kind: type, data: st.DataObject) -> None:
    """NaN and the infinities apart, which are strings, and which no type of a schema has."""
    message_format = format_of(message := data.draw(strategy(kind)))
    text = to_bytes(message_format.encode(message)).decode()
    finite = json.loads(re.sub(r'"(NaN|-?Infinity)"', "0.0", text))
    jsonschema.validate(finite, message_format.schema)


def test_every_message_between_the_packages_can_be_logged() -> None:
    alive = {m.__name__ for m in message_types()}
    between = {
        name
        for name, kind in vars(messages).items()
        if dataclasses.is_dataclass(kind) and "stamp_ns" in {f.name for f in dataclasses.fields(kind)}
    }
    assert between <= alive
    assert {kind.__name__ for kind in typing.get_args(messages.SensorMessage)} <= alive


def test_an_unknown_message_type_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="'str'"):
        format_of("words")
    with pytest.raises(UnknownNameError, match="'Nothing'"):
        format_named("Nothing")


def test_renamed_classes_keep_their_names_in_logs() -> None:
    for name in ("Situation", "Clearance"):
        assert format_named(name).schema["title"] == f"msrr.{name}"


def test_a_window_of_an_old_log_holds_its_own_pixels() -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (7, 33), dtype=np.uint8)
    window = CameraWindow(Exposure("a/onboard", 3, 40), Window(5, 6, 33, 7), pixels)
    message_format = format_of(window)
    data = base64.b64encode(cv2.imencode(".png", pixels)[1].tobytes()).decode()
    old = {"data": data, "msrr": message_format.encode(window)}
    assert bits(message_format.decode(old)) == bits(window)
    old["msrr"]["window"]["height"] = 8
    with pytest.raises(LogError, match="8 pixels holds an image"):
        message_format.decode(old)
