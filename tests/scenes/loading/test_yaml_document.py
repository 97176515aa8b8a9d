"""YAML documents: plain values with the place of each, and overrides that replace values and places."""

from msrr_scenes.loading.yaml_document import apply_overrides, parse_document

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


def test_overrides_replace_values_and_their_lines() -> None:
    document = parse_document(TEXT, "file")
    apply_overrides(document, {"b.c.0": "[1, 2]", "g.h": "true", "b.d": "3"})
    assert document.data["b"] == {"c": [[1, 2], "2020-01-01"], "d": 3}
    assert document.data["g"] == {"h": True}
    assert document.origin(("b", "c", 0, 1)) == "--set b.c.0=[1, 2]"
    assert document.origin(("b", "d", "e")) == "--set b.d=3"
    assert document.origin(("g",)) == "--set g.h=true"
    assert document.origin(("b", "c", 1)) == "file:3:10"
