"""YAML that remembers where everything was written: safe scalars only, no duplicate keys, bounded size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import yaml

from msrr_scenes.errors import SceneError
from msrr_scenes.loading.problems import KeyPath, dotted

MAX_BYTES = 1_000_000
MAX_DEPTH = 24
MAX_VALUES = 20_000

_PLAIN = {f"tag:yaml.org,2002:{kind}" for kind in ("null", "bool", "int", "float", "str", "timestamp")}


@dataclass
class Marked:
    """A document and the origin (``file:line`` or the option) of each of its values.

    Attributes:
        data: The document: dicts, lists and plain values.
        origins: Origin of every key path; the root is the empty path.
    """

    data: dict[str, Any]
    origins: dict[KeyPath, str] = field(default_factory=dict)

    def origin(self, path: KeyPath) -> str:
        """Return the origin of a path, or of the nearest enclosing one that was written."""
        while path not in self.origins and path:
            path = path[:-1]
        return self.origins.get(path, "scene")


def parse_scalar(text: str, origin: str) -> Any:
    """Read a value given on the command line as YAML (a number, a flag, a text, ``[1, 2]``, ``{a: 1}``).

    Raises:
        SceneError: The text is not YAML that a scene file could hold.
    """
    node = _compose(text, origin)
    return None if node is None else _Reader(lambda _: origin).value(node, (), 0)


def parse_document(text: str, source: str) -> Marked:
    """Parse a scene file.

    Args:
        text: Its content.
        source: Its name, for messages.

    Raises:
        SceneError: Not YAML, not one mapping, a key written twice, an exotic type, or too large.
    """
    if len(text) > MAX_BYTES:
        raise SceneError(f"{source}: a scene file of more than {MAX_BYTES} characters is refused")
    node = _compose(text, source)
    if not isinstance(node, yaml.MappingNode):
        found = "nothing" if node is None else "a list" if isinstance(node, yaml.SequenceNode) else "a value"
        raise SceneError(f"{source}:1: expected `key: value` lines at the top, found {found}")
    reader = _Reader(lambda mark: f"{source}:{mark.line + 1}")
    data = reader.value(node, (), 0)
    return Marked(data, reader.origins)


def _compose(text: str, origin: str) -> yaml.Node | None:
    try:
        # The composer recurses; the parser does not. So depth is measured on events first.
        depth = 0
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                place = _at(origin, event.start_mark.line) if event.start_mark else origin
                raise SceneError(f"{place}: nested more than {MAX_DEPTH} levels deep")
        return yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = _at(origin, mark.line) if mark else origin
        raise SceneError(f"{place}: not valid YAML: {error.problem or error.context}") from None
    except yaml.reader.ReaderError as error:
        place = _at(origin, text.count("\n", 0, error.position))
        raise SceneError(
            f"{place}: not valid YAML: the character U+{error.character:04X} is not allowed"
        ) from None


def _at(origin: str, line: int) -> str:
    """Return the origin with its line (given from 0); an option of the command line has none."""
    return origin if origin.startswith("--") else f"{origin}:{line + 1}"


class _Reader:
    """Turns nodes into plain values; an alias is read again at each use, within the bound on values."""

    def __init__(self, origin_of: Any) -> None:
        self.origins: dict[KeyPath, str] = {}
        self._origin_of = origin_of
        self._scalars = yaml.constructor.SafeConstructor()
        self._count = 0

    def value(self, node: yaml.Node, path: KeyPath, depth: int) -> Any:
        origin = self._origin_of(node.start_mark)
        self.origins.setdefault(path, origin)
        self._count += 1
        if self._count > MAX_VALUES or depth > MAX_DEPTH:  # aliases can multiply, or contain themselves
            raise SceneError(f"{origin}: more than {MAX_VALUES} values or {MAX_DEPTH} levels after aliases")
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path, depth)
        if isinstance(node, yaml.SequenceNode):
            self._refuse_tag(node, "seq", origin)
            return [self.value(item, (*path, i), depth + 1) for i, item in enumerate(node.value)]
        return self._scalar(node, origin)

    def _mapping(self, node: yaml.MappingNode, path: KeyPath, depth: int) -> dict[str, Any]:
        self._refuse_tag(node, "map", self._origin_of(node.start_mark))
        mapping: dict[str, Any] = {}
        for key_node, value_node in node.value:
            origin = self._origin_of(key_node.start_mark)
            if not isinstance(key_node, yaml.ScalarNode):
                raise SceneError(f"{origin}: {dotted(path) or 'scene'}: a key has to be a plain word")
            key = str(key_node.value)
            here = (*path, key)
            if key == "<<":
                raise SceneError(f"{origin}: {dotted(path) or 'scene'}: merge keys are not supported here")
            if key in mapping:
                raise SceneError(
                    f"{origin}: {dotted(here)}: this key is already given at {self.origins[here]}; keep one"
                )
            self.origins[here] = origin
            mapping[key] = self.value(value_node, here, depth + 1)
        return mapping

    def _scalar(self, node: yaml.Node, origin: str) -> Any:
        if node.tag not in _PLAIN:
            raise SceneError(f"{origin}: values of type {node.tag} are not allowed in a scene")
        if node.tag.endswith(("timestamp", ":str")):  # a date is a text that looks like one
            return str(node.value)
        try:
            return self._scalars.construct_object(node)
        except (ValueError, yaml.YAMLError):
            raise SceneError(f"{origin}: {node.value!r} is not a value of type {node.tag}") from None

    @staticmethod
    def _refuse_tag(node: yaml.Node, kind: str, origin: str) -> None:
        if node.tag != f"tag:yaml.org,2002:{kind}":
            raise SceneError(f"{origin}: values of type {node.tag} are not allowed in a scene")


def apply_overrides(document: Marked, overrides: Mapping[str, str]) -> None:
    """Write ``a.b.c=value`` pairs into a document; lists by index, missing mappings are made.

    Raises:
        SceneError: A path that leads through a plain value or past the end of a list.
    """
    for key, text in overrides.items():
        option = f"--set {key}={text}"
        parts = key.split(".")
        if not all(parts):
            raise SceneError(f"{option}: expected a dotted key such as cameras.onboard.noise_grey")
        _put(document, parts, parse_scalar(text, option), option)


def _put(document: Marked, parts: list[str], value: Any, option: str) -> None:
    here: Any = document.data
    path: KeyPath = ()
    for depth, part in enumerate(parts):
        last = depth == len(parts) - 1
        if isinstance(here, list):
            if not part.isdecimal() or int(part) >= len(here):
                valid = f"0 .. {len(here) - 1}" if here else "none, it is empty"
                raise SceneError(
                    f"{option}: {dotted(path)} is a list; expected an index ({valid}), found {part!r}"
                )
            index: str | int = int(part)
        elif isinstance(here, dict):
            index = part
            if not last and here.get(part) is None:
                here[part] = {}
                document.origins[(*path, part)] = option
        else:
            raise SceneError(f"{option}: {dotted(path)} is a plain value and has no key {part!r}")
        path = (*path, index)
        if last:
            here[index] = value
            for old in [p for p in document.origins if p[: len(path)] == path]:
                del document.origins[old]
            document.origins[path] = option
        else:
            here = here[index]
