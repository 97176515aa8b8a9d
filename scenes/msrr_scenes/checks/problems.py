"""A problem in a scene, with its key path and the way to mend it."""

from __future__ import annotations

from dataclasses import dataclass

#: Path of a value in a scene: keys of mappings and indices of lists.
KeyPath = tuple[str | int, ...]


def dotted(path: KeyPath) -> str:
    """Return a key path as it is written on the command line: ``units.a.pose.x_m``."""
    return ".".join(str(part) for part in path)


@dataclass(frozen=True)
class Problem:
    """A reason why a scene is unusable.

    Attributes:
        path: Key path of the value at fault.
        text: What was expected, what was found, and how to mend it.
        rank: Order in the message; problems of a higher rank may only follow from others and come last.
    """

    path: KeyPath
    text: str
    rank: int = 0
