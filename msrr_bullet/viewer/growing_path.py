"""Paths of units that grow while a trial runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from msrr_bullet.viewer.commands import Command
from msrr_bullet.viewer.scene_graph import PATH_STEP
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2

#: Number of points of a path that are drawn as one band, so that the cost of an update does not grow with the
#: length of the path.
BAND_POINTS = 100


class GrowingPath:
    """The path of a unit as a sequence of bands, of which only the last is redrawn when the path grows."""

    def __init__(self, unit: str, draw: Callable[[str, int, Sequence[Array]], Iterator[Command]]) -> None:
        """Begin without a point; ``draw`` draws a band of the unit, given its number and its points in W."""
        self._unit, self._draw_piece = unit, draw
        self._index = 0
        self._points: list[Array] = []
        self._waiting: list[Command] = []
        self._grown = False

    def add(self, X: SE2 | None) -> None:
        """Go on to a pose in W; None ends the band, and the next pose begins another one elsewhere."""
        if X is None:
            if self._points:
                self._finish([])
            return
        if self._points and np.linalg.norm(X.translation - self._points[-1]) < PATH_STEP:
            return
        self._points.append(X.translation)
        self._grown = True
        if len(self._points) >= BAND_POINTS:
            self._finish(self._points[-1:])

    def _finish(self, start: list[Array]) -> None:
        self._waiting += self._draw()
        self._index += 1
        self._points = start

    def _draw(self) -> Iterator[Command]:
        self._grown = False
        return self._draw_piece(self._unit, self._index, tuple(self._points))

    def commands(self) -> list[Command]:
        """Return what draws the path as far as it has grown since the last call."""
        commands, self._waiting = self._waiting, []
        return commands + list(self._draw()) if self._grown else commands
