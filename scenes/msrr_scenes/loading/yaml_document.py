"""YAML documents that record the place of every value: plain types, unique keys, bounded size."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from msrr_scenes.checks.problems import KeyPath, dotted
from msrr_scenes.errors import SceneError

#: Largest file [characters] and number of values: more than a map of all tags of the default family has.
MAX_CHARACTERS = 1_000_000
MAX_DEPTH = 24
MAX_VALUES = 50_000
#: Longest number [characters], of which double precision uses no more than 17 digits.
MAX_NUMBER = 40
#: Numbers that YAML 1.1 has to the base 8 or 60, and YAML 1.2, and people, do not.
_OTHER_BASE = re.compile(r"[-+]?0[0-9_]+|[-+]?[0-9][0-9_]*:.*")
#: Numbers that YAML 1.2, and people, read as such, and YAML 1.1 as texts: ``1e-3`` has no point.
_EXPONENT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)[eE][-+]?[0-9]+\Z")
#: Longest key [characters].
MAX_KEY = 100

#: What the parser calls things that are opened and closed, by brackets or quotation marks.
_OPENED = re.compile("flow (mapping|sequence)|quoted scalar")
#: A line in which a space is missing behind the colon of a key.
_NO_SPACE = re.compile(r"\s*(?:- )?([a-z]\w*):([^\s:]\S*)\s*(?:#.*)?")
#: What is wrong where the parser wants no key.
_NO_KEY = "no key is expected here; check indentation, and put a text with a colon in quotes"
#: Parts of messages of the parser that only its authors understand, and what is to be said instead.
_WORDS: Mapping[str, str] = {
    r"'\t'": "a tab; indent with spaces",
    "cannot start any token": "a text that begins with this character has to be in quotes",
    "the node content": "a value is expected here",
    "another document": "a second document begins here; a file holds one",
    "<block end>": "this does not go with what stands before it; check indentation, brackets and quotes",
    "mapping values": _NO_KEY,
}

_TAG = "tag:yaml.org,2002:"
_SCALARS = {_TAG + kind for kind in ("null", "bool", "int", "float", "str", "timestamp")}
_ALLOWED = {yaml.MappingNode: {_TAG + "map"}, yaml.SequenceNode: {_TAG + "seq"}, yaml.ScalarNode: _SCALARS}


@dataclass
class YamlDocument:
    """A parsed document, of dicts, lists and plain values, and the origin of every key path.

    An origin is ``file:line:column`` or a command-line option; the root is the empty path.
    """

    data: dict[str, Any]
    origins: dict[KeyPath, str] = field(default_factory=dict)

    def origin(self, path: KeyPath) -> str:
        """Return the origin of a path, or of the nearest enclosing path that was written."""
        while path not in self.origins and path:
            path = path[:-1]
        return self.origins.get(path, "scene")


def read_text(path: Path) -> str:
    """Return the text of a file.

    Raises:
        SceneError: The file cannot be read, is too large, or is no text in UTF-8.
    """
    try:
        with path.open(encoding="utf-8-sig") as file:
            text = file.read(MAX_CHARACTERS + 1)  # an endless one would fill the memory
    except UnicodeDecodeError as error:
        where = f"{error.reason} at byte {error.start}"
        raise SceneError(f"{path}: not UTF-8 text: {where}; save the file as UTF-8") from None
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    if len(text) > MAX_CHARACTERS:
        raise SceneError(f"{path}: a file of more than {MAX_CHARACTERS} characters is refused")
    return text


def parse_document(text: str, source: str) -> YamlDocument:
    """Parse the text of a scene file, whose name for messages is ``source``.

    Raises:
        SceneError: The text is no YAML or no mapping, gives a key twice, holds a type that is not plain, or
            has too many values.
    """
    node = _compose(text, source)
    if not isinstance(node, yaml.MappingNode):
        found = "nothing" if node is None else "a list" if isinstance(node, yaml.SequenceNode) else "a value"
        raise SceneError(f"{source}:1: expected `key: value` lines at the top, found {found}")
    reader = _Reader(source)
    data = reader.value(node, (), 0)
    return YamlDocument(data, reader.origins)


def parse_value(text: str, source: str) -> Any:
    """Return the plain value that a text of YAML stands for, None for an empty one.

    ``source`` says in messages where it was given.

    Raises:
        SceneError: It is no YAML that a scene file could hold.
    """
    node = _compose(text, source)
    return None if node is None else _Reader(source).value(node, (), 0)


def _compose(text: str, source: str) -> yaml.Node | None:
    loader: _Composer | None = None
    try:
        loader = _Composer(text, source)
        return loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        mark, problem = _in_words(error)
        line, column = (mark.line, mark.column) if mark else (0, 0)
        if problem == _NO_KEY:
            line, column, problem = _without_space(text.splitlines(), line) or (line, column, problem)
        place = _position(source, line, column) if mark else source
        raise SceneError(f"{place}: not valid YAML: {problem}") from None
    except yaml.reader.ReaderError as error:
        line_start = text.rfind("\n", 0, error.position) + 1
        place = _position(source, text.count("\n", 0, error.position), error.position - line_start)
        mend = "" if error.character else "; save the file as UTF-8"  # every second byte of one in UTF-16
        raise SceneError(
            f"{place}: not valid YAML: the character U+{error.character:04X} is not allowed{mend}"
        ) from None
    except (ValueError, OverflowError):  # of chr(), for "\\U00110000" and beyond
        assert loader is not None
        place = _position(source, loader.line, loader.column)
        raise SceneError(f"{place}: not valid YAML: no character has the number of this escape") from None


def _in_words(error: yaml.MarkedYAMLError) -> tuple[yaml.Mark | None, str]:
    """Return the place of a mistake in YAML, and the mistake in words for who does not know its grammar."""
    context, found = error.context or "", error.problem or ""
    mark = error.problem_mark or error.context_mark
    if "end of stream" in found or "stream end" in found:
        opened = error.context_mark if _OPENED.search(context) else None
        return opened or mark, "this is never closed" if opened else "the text ends where a value is expected"
    if "could not find expected ':'" in found:
        return error.context_mark or mark, "a line that is neither `key: value` nor part of a list"
    if _OPENED.search(context) and found.startswith("expected ','") and error.context_mark:
        opened = error.context_mark
        closing = found.partition(", but")[0]
        return (
            mark,
            f"{closing} for the bracket that opens in line {opened.line + 1}, column {opened.column + 1}",
        )
    return mark, next((words for part, words in _WORDS.items() if part in found), found or context)


def _without_space(lines: list[str], at: int) -> tuple[int, int, str] | None:
    """Return line, column and mistake of a key without a space behind its colon in the line before ``at``."""
    before = next((k for k in range(at - 1, -1, -1) if lines[k].strip()), None)
    found = None if before is None else _NO_SPACE.fullmatch(lines[before])
    if before is None or found is None:
        return None
    key, value = found.groups()
    return before, found.start(1), f"a space is missing behind the colon, as in `{key}: {value}`"


class _Composer(yaml.SafeLoader):
    """Composes the nodes of a document, and refuses collections in too many others, for it recurses."""

    def __init__(self, text: str, source: str) -> None:
        super().__init__(text)
        self._source, self._depth = source, 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        opens = self.check_event(yaml.CollectionStartEvent)
        self._depth += opens
        if self._depth > MAX_DEPTH:
            peek: Callable[[], yaml.Event] = self.peek_event
            raise SceneError(f"{_place(self._source, peek())}: nested more than {MAX_DEPTH} levels deep")
        node = super().compose_node(parent, index)
        self._depth -= opens
        return node


class Dumper(yaml.SafeDumper):
    """Writes values so that they are read again as they are: texts that look like numbers get quotes."""


for _class in (_Composer, Dumper):
    _class.add_implicit_resolver(_TAG + "float", _EXPONENT, list("-+.0123456789"))


def _position(source: str, line: int, column: int) -> str:
    """Return a source with line and column, counted from 0; an option of the command line has neither."""
    return source if source.startswith("--") else f"{source}:{line + 1}:{column + 1}"


def _place(source: str, item: yaml.Node | yaml.Event) -> str:
    mark = item.start_mark
    return _position(source, mark.line, mark.column) if mark else source


def _checked_text(text: str, origin: str) -> str:
    """Return a text that can be written; a lone surrogate, which YAML can escape, is no character."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise SceneError(f"{origin}: U+{ord(text[error.start]):04X} is half a character; remove it") from None
    return text


class _Reader:
    """Converts nodes to plain values; an alias is read again at each use, within the bound on values."""

    def __init__(self, source: str) -> None:
        self.origins: dict[KeyPath, str] = {}
        self._source = source
        self._scalars = yaml.constructor.SafeConstructor()
        self._count = 0

    def value(self, node: yaml.Node, path: KeyPath, depth: int) -> Any:
        origin = _place(self._source, node)
        self.origins.setdefault(path, origin)
        self._count += 1
        if self._count > MAX_VALUES or depth > MAX_DEPTH:  # aliases can multiply, or contain themselves
            raise SceneError(f"{origin}: more than {MAX_VALUES} values or {MAX_DEPTH} levels after aliases")
        if node.tag not in _ALLOWED[type(node)]:
            raise SceneError(f"{origin}: values of type {node.tag} are not allowed in a scene")
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path, depth)
        if isinstance(node, yaml.SequenceNode):
            return [self.value(item, (*path, i), depth + 1) for i, item in enumerate(node.value)]
        if node.tag in (_TAG + "timestamp", _TAG + "str"):  # a date is a text that looks like one
            return _checked_text(str(node.value), origin)
        if len(node.value) > MAX_NUMBER:
            raise SceneError(f"{origin}: a number of more than {MAX_NUMBER} characters is refused")
        if _OTHER_BASE.fullmatch(node.value):
            raise SceneError(
                f"{origin}: {node.value} is a number to another base than ten in YAML; "
                "write it without a leading 0 or a colon"
            )
        try:
            return self._scalars.construct_object(node)
        except (ValueError, LookupError, yaml.YAMLError):  # LookupError: `!!bool maybe`, `!!int ""`
            raise SceneError(
                f"{origin}: {node.value!r} is not a value of type {node.tag}; put a text in quotes"
            ) from None

    def _mapping(self, node: yaml.MappingNode, path: KeyPath, depth: int) -> dict[str, Any]:
        mapping: dict[str, Any] = {}
        for key_node, value_node in node.value:
            origin = _place(self._source, key_node)
            if not isinstance(key_node, yaml.ScalarNode):
                raise SceneError(f"{origin}: {dotted(path) or 'scene'}: a key has to be a plain word")
            key = _checked_text(str(key_node.value), origin)
            if len(key) > MAX_KEY:
                raise SceneError(f"{origin}: a key of more than {MAX_KEY} characters is refused")
            key_path = (*path, key)
            if key == "<<":
                raise SceneError(
                    f"{origin}: {dotted(path) or 'scene'}: merge keys are not read; write the keys out, or "
                    "take all of a mapping by an alias, as in `frames: *frames`"
                )
            if key in mapping:
                given = self.origins[key_path]
                raise SceneError(
                    f"{origin}: {dotted(key_path)}: this key is already given at {given}; keep one"
                )
            self.origins[key_path] = origin
            mapping[key] = self.value(value_node, key_path, depth + 1)
        return mapping
