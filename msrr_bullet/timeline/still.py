"""Stills: annotated frames of a run as small files, which a page shows beside its 3-D view."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Still:
    """Annotated frame of a camera.

    Attributes:
        camera: Name of the camera, as in :class:`msrr_scenes.messages.Exposure`.
        stamp_ns: Time of exposure.
        data: The picture, a file.
        text: What was found in the frame, in words.
        legend: Meanings of the colours: each a text, its colour, and whether the line is dashed.
        kind: Format of the file, as in its media type ``image/...``.
    """

    camera: str
    stamp_ns: int
    data: bytes
    text: str
    legend: tuple[tuple[str, int, bool], ...] = ()
    kind: str = "webp"
