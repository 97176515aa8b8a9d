"""A problem found in a scene: where it is and how to mend it."""

from __future__ import annotations

from dataclasses import dataclass

#: Where a value sits in a scene: keys of mappings and indices of lists.
KeyPath = tuple[str | int, ...]


def dotted(path: KeyPath) -> str:
    """Return a key path as it is written on the command line: ``units.a.pose.x_m``."""
    return ".".join(str(part) for part in path)


@dataclass(frozen=True)
class Problem:
    """One thing that makes a scene unusable.

    Attributes:
        path: Key path of the value at fault.
        text: What was expected, what was found, and the mend.
        rank: Problems of a higher rank may only follow from others and are listed last.
    """

    path: KeyPath
    text: str
    rank: int = 0
