"""The one root of every exception that this project raises on purpose.

An exception means misuse (a bad scene, an unknown name, a file that is not there). A docking that
fails is not an exception: it is an :class:`msrr_scenes.outcome.Outcome`.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class MsrrError(Exception):
    """Root of all errors raised by msrr packages; its text names the place and the mend."""


class SceneError(MsrrError):
    """A scene that cannot be used as written."""


class GeometryError(MsrrError):
    """A unit description (URDF) that lacks a named frame or contradicts itself."""


class UnknownNameError(MsrrError):
    """A name that no registered or importable implementation answers to."""

    def __init__(self, kind: str, name: str, valid: Iterable[str], hint: str = "") -> None:
        """Say what ``name`` was meant to be (``kind``), which names exist, and which is nearest."""
        names = sorted(valid)
        near = difflib.get_close_matches(name, names, n=1)
        text = f"unknown {kind} {name!r}"
        text += f"; did you mean {near[0]!r}?" if near else "."
        text += f" Known: {', '.join(names) or 'none'}."
        super().__init__(f"{text} {hint}".rstrip())
