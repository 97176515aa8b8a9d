"""Arguments and options that several commands share, and how their texts are read."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from msrr_scenes.errors import SceneError

SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="Name of a shipped scene, or a scene file.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Overrides a value of the scene; may be repeated."),
]
JsonFile = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Writes the numbers as JSON; - is standard output."),
]


def parse_overrides(pairs: Sequence[str] | None) -> dict[str, str]:
    """Turn ``KEY=VALUE`` texts into a mapping.

    Raises:
        SceneError: A text without ``=``, or a key given twice.
    """
    overrides: dict[str, str] = {}
    for pair in pairs or ():
        key, equals, value = pair.partition("=")
        if not equals or not key:
            raise SceneError(f"--set {pair}: expected KEY=VALUE, such as cameras.onboard.noise_grey=8")
        if key in overrides:
            raise SceneError(f"--set {pair}: {key} is already set to {overrides[key]!r}; give it once")
        overrides[key] = value
    return overrides


def parse_seeds(text: str) -> range:
    """Turn ``A:B`` into the seeds A .. B - 1, and ``A`` into one seed.

    Raises:
        SceneError: Anything else.
    """
    first, colon, last = text.partition(":")
    try:
        start = int(first)
        seeds = range(start, int(last) if colon else start + 1)
    except ValueError:
        raise SceneError(f"--seeds {text}: expected A:B (seeds A to B - 1) or one number") from None
    if not seeds or start < 0:
        raise SceneError(f"--seeds {text}: expected A:B with 0 <= A < B")
    return seeds


def check_writable(file: Path | None) -> None:
    """Find out before an hour of work that its result could not be written."""
    if file is not None and file != Path("-") and (file.is_dir() or not file.absolute().parent.is_dir()):
        raise SceneError(f"--json {file}: not a file in an existing folder")


def write_json(file: Path | None, text: str) -> None:
    """Write ``text`` where ``--json`` says, if it was given."""
    if file == Path("-"):
        sys.stdout.write(text)
    elif file is not None:
        file.write_text(text, encoding="utf-8")
