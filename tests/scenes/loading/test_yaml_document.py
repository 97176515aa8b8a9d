"""YAML documents: plain values with the place of each, and overrides that replace values and places."""

from pathlib import Path

import numpy as np
import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.loading.overrides import apply_overrides, override_text
from msrr_scenes.loading.yaml_document import MAX_DEPTH, parse_document

TEXT = """\
a: 1
b:
  c: [x, 2020-01-01]
  d: &d {e: 2.5}
f: *d
"""


def test_values_are_plain_and_every_path_has_its_line_and_column() -> None:
    document = parse_document(TEXT, "file")
    assert document.data == {"a": 1, "b": {"c": ["x", "2020-01-01"], "d": {"e": 2.5}}, "f": {"e": 2.5}}
    assert document.origin(("b", "c", 1)) == "file:3:10"
    assert document.origin(("b", "d", "e")) == "file:4:10"
    assert document.origin(("b", "c", 7, "nothing")) == "file:3:3"  # the nearest enclosing path
    assert document.origin(("f", "e")) == "file:4:10"  # an alias is where its anchor is


@pytest.mark.parametrize("text", ["1e-3", "1.e-3", "+1E-3", "0.001", ".1e-2"])
def test_a_number_with_an_exponent_is_a_number(text: str) -> None:
    """A parameter of a class of one's own, which nothing converts, was the text ``1e-3``."""
    assert parse_document(f"a: {text}\nb: '{text}'\n", "file").data == {"a": 1e-3, "b": text}


def test_overrides_replace_values_and_their_lines() -> None:
    document = parse_document(TEXT, "file")
    apply_overrides(document, {"b.c.0": "[1, 2]", "g.h": "true", "b.d": "3"})
    assert document.data["b"] == {"c": [[1, 2], "2020-01-01"], "d": 3}
    assert document.data["g"] == {"h": True}
    assert document.origin(("b", "c", 0, 1)) == "override b.c.0=[1, 2]"
    assert document.origin(("b", "d", "e")) == "override b.d=3"
    assert document.origin(("g",)) == "override g.h=true"
    assert document.origin(("b", "c", 1)) == "file:3:10"


@pytest.mark.parametrize(
    "value",
    [
        150,
        -2,
        1e-5,
        1e20,
        float("inf"),
        True,
        None,
        [1, [2.5, "a"]],
        {"a": {"b": [None, "1"]}, "c": "true"},
        {"gain": 1e-3, "text": "1e-3"},
        [],
    ],
    ids=str,
)
def test_a_value_of_python_comes_back_from_its_text(value: object) -> None:
    document = parse_document("{}", "file")
    apply_overrides(document, {"key": override_text("key", value)})
    assert document.data == {"key": value}
    assert type(document.data["key"]) is type(value)


def test_a_scene_takes_values_of_python_and_of_numpy_as_it_takes_texts() -> None:
    """An integer was answered with an AttributeError."""
    texts = {"link.latency_ms": "150", "los": "{inner_deg: 18.5}", "as_built": "perfect"}
    values = {"link.latency_ms": 150, "los": {"inner_deg": np.float64(18.5).item()}, "as_built": "perfect"}
    scene = load_scene("close_range_hard", texts)
    nested = {**values, "los": {"inner_deg": np.float64(18.5)}}
    for other in (values, {**values, "link.latency_ms": np.int64(150)}, nested):
        assert load_scene("close_range_hard", other).model_dump() == scene.model_dump()
    with pytest.raises(SceneError, match=r"link\.latency_ms: expected a text, a number, .* of type object"):
        load_scene("close_range_hard", {"link.latency_ms": object()})
    with pytest.raises(SceneError, match=r"control\.docking: .* a class, .* 'pathlib:Path'"):
        load_scene("close_range_hard", {"control.docking": Path})


def test_merge_keys_are_refused_with_the_way_without_them() -> None:
    with pytest.raises(SceneError, match=r"file:2:5: b: merge keys are not read; .* `frames: \*frames`"):
        parse_document("a: &a {x: 1}\nb: {<<: *a}\n", "file")


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ('"\\U00110000"', "no character has the number of this escape"),
        ('"\\UFFFFFFFF"', "no character has the number of this escape"),
        ("0200", "0200 is a number to another base than ten"),
        ("3:20", "3:20 is a number to another base than ten"),
        ("!!bool maybe", "'maybe' is not a value of type tag:yaml.org,2002:bool; put a text in quotes"),
    ],
)
def test_values_that_the_parser_stumbles_over_are_named(value: str, said: str) -> None:
    with pytest.raises(SceneError, match=rf"^x\.yaml:2:\d+: .*{said}"):
        parse_document(f"a: 1\nb: {value}\n", "x.yaml")


@pytest.mark.parametrize("text", ["1e5 trials of a unit", "5e3a91", "2e4-noise", "3e2robot.urdf", "1e", "e5"])
def test_a_text_that_begins_like_a_number_with_an_exponent_is_a_text(text: str) -> None:
    assert parse_document(f"a: {text}\n", "file").data == {"a": text}


def test_depth_is_bounded_where_it_is_exceeded() -> None:
    """The top is one level; a flat document may have any number of collections beside each other."""
    lists = MAX_DEPTH - 1
    flat = "".join(f"k{i}: [[1]]\n" for i in range(2 * MAX_DEPTH))
    assert len(parse_document(flat, "a.yaml").data) == 2 * MAX_DEPTH
    assert parse_document(f"a: {'[' * lists}{']' * lists}", "a.yaml").data
    for deeper in (lists + 1, 10_000):
        with pytest.raises(SceneError, match=rf"^a.yaml:1:{4 + lists}: nested more than {MAX_DEPTH} levels"):
            parse_document(f"a: {'[' * deeper}{']' * deeper}", "a.yaml")
