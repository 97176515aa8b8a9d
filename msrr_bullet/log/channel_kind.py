"""What the messages of a topic are, as files and clients are told it."""

from __future__ import annotations

from typing import NamedTuple


class ChannelKind(NamedTuple):
    """Schema and encoding of the messages of a topic, and names and values that a reader has to know besides.

    The schema is ``jsonschema`` or ``protobuf``, the messages are ``json`` or ``protobuf``.
    """

    name: str
    schema_encoding: str
    schema: bytes
    encoding: str
    metadata: tuple[tuple[str, str], ...]
