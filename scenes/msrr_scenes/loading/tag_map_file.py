"""Maps of tags in files (YAML)."""

from __future__ import annotations

from pathlib import Path

import yaml
from pydantic import ValidationError

from msrr_scenes.checks.problems import dotted
from msrr_scenes.errors import SceneError
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
        return TagMapSpec.model_validate(document.data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        text = f"{document.origin(first['loc'])}: {dotted(first['loc'])}: {first['msg']}"
        raise SceneError(f"{text}; expected a map of tags as msrr map writes it") from None


def write_tag_map(path: Path, tag_map: TagMapSpec) -> None:
    """Write a map of tags as :func:`read_tag_map` reads it."""
    data = tag_map.model_dump(mode="json")
    write_whole(path, yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=110))
