"""Maps of tags in files (YAML)."""

from __future__ import annotations

from pathlib import Path

import yaml
from pydantic import ValidationError

from msrr_scenes.checks.problems import dotted
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.validation_errors import explain
from msrr_scenes.loading.yaml_document import parse_document, read_text
from msrr_scenes.specs.tag_map import TagMapSpec
from msrr_scenes.whole_files import write_whole


def read_tag_map(path: Path) -> TagMapSpec:
    """Read a map of tags.

    Raises:
        SceneError: The file cannot be read, or is no such map.
    """
    text = read_text(path)
    document = parse_document(text, str(path))
    try:
        tag_map = TagMapSpec.model_validate(document.data)
    except ValidationError as error:
        found = (explain(e, document, TagMapSpec) for e in error.errors(include_url=False))
        first = min((problem for problem in found if problem is not None), key=lambda p: p.rank)
        text = f"{document.origin(first.path)}: {dotted(first.path) or 'the file'}: {first.text}"
        raise SceneError(f"{text}; expected a map of tags as msrr map writes it") from None
    if tag_map.reference not in tag_map.tags:
        origin = document.origin(("reference",))
        raise SceneError(f"{origin}: reference: the map has no tag {tag_map.reference}, in whose frame it is")
    return tag_map


def write_tag_map(path: Path, tag_map: TagMapSpec) -> None:
    """Write a map of tags as :func:`read_tag_map` reads it."""
    data = tag_map.model_dump(mode="json")
    write_whole(path, yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=110))
