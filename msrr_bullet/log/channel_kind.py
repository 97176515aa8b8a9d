"""What the messages of a topic are, as files and clients are told it."""

from __future__ import annotations

from typing import NamedTuple


class ChannelKind(NamedTuple):
    """Schema and encoding of the messages of a topic, and what a reader has to know besides.

    Attributes:
        name: Name of the schema.
        schema_encoding: ``jsonschema`` or ``protobuf``.
        schema: The schema.
        encoding: ``json`` or ``protobuf``.
        metadata: Names and values.
    """

    name: str
    schema_encoding: str
    schema: bytes
    encoding: str
    metadata: tuple[tuple[str, str], ...]
