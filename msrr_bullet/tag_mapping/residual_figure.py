"""The figure of residuals: by size of the tag in the picture, by angle of view, by picture and by tag."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogFormatter

from msrr_bullet.figures.plots.style import SMALL, new_figure, save, styled
from msrr_bullet.timeline.palette import BLUE, VERMILLION, css
from msrr_perception.mapping.mapper import MappedSighting, TagMap
from msrr_scenes.wording import counted

#: Largest number of pictures whose names fit below an axis.
_MOST_NAMES = 60

_WIDTH_IN, _HEIGHT_IN = 15.0, 9.5


class _PlainNumbers(LogFormatter):
    """Labels of a logarithmic axis without powers of ten: figures have no mathematical text."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""


def draw_residuals(tag_map: TagMap, path: Path) -> Path:
    """Draw the distances of all corners from where the map puts them to a PNG file; return the file."""
    with styled():
        figure = new_figure(_WIDTH_IN, _HEIGHT_IN)
        by_size, by_angle, by_picture, by_tag = figure.subplots(2, 2, width_ratios=(1.6, 1.0)).T.ravel()[
            [0, 2, 1, 3]
        ]
        _scatter(
            by_size, tag_map, [s.edge_px for s in tag_map.sightings], "edge of the tag in the picture [px]"
        )
        angles = [math.degrees(s.angle) for s in tag_map.sightings]
        _scatter(by_angle, tag_map, angles, "angle from the normal of the tag [deg]")
        by_angle.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False)
        _bars(by_picture, tag_map.sightings, [s.picture for s in tag_map.sightings], "picture")
        _bars(by_tag, tag_map.sightings, [str(s.tag_id) for s in tag_map.sightings], "tag")
        figure.suptitle(_title(tag_map))
        return save(figure, path)


def headline(tag_map: TagMap) -> str:
    """Return in words what the map was made of, how well it agrees with that, and how much was left out."""
    distances = tag_map.distances()
    return (
        f"{counted(len(tag_map.tags), 'tag')} in {counted(len(tag_map.X_CM), 'picture')}: corner residuals "
        f"{np.median(distances):.2f} px (median), {np.sqrt(np.mean(distances**2)):.2f} px (RMS); "
        f"{sum(not s.kept for s in tag_map.sightings)} of {len(tag_map.sightings)} sightings left out"
    )


def _title(tag_map: TagMap) -> str:
    placeless = sum(bool(np.isnan(s.residuals).any()) for s in tag_map.sightings)
    if not placeless:
        return headline(tag_map)
    return f"{headline(tag_map)},\n{placeless} of them without residual: their tag or picture is not used"


def _scatter(axes: Axes, tag_map: TagMap, places: Sequence[float], label: str) -> None:
    for kept, colour, marker, name in ((True, BLUE, ".", "used"), (False, VERMILLION, "x", "left out")):
        chosen = [(x, s.distances) for x, s in zip(places, tag_map.sightings, strict=True) if s.kept == kept]
        x = np.repeat([x for x, _ in chosen], 4)
        y = np.array([d for _, d in chosen]).ravel()
        axes.plot(x, y, marker, color=css(colour), label=name, markersize=7.0, alpha=0.7)
    axes.set_yscale("log")
    for write in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        write(_PlainNumbers(minor_thresholds=(1.0, 0.4)))
    axes.set_xlabel(label)
    axes.set_ylabel("corner residual [px]")


def _bars(axes: Axes, sightings: Sequence[MappedSighting], keys: Sequence[str], label: str) -> None:
    """Draw the root mean square of what was used, by key: numbers in order, names by their lengths."""
    names = sorted(set(keys), key=lambda key: (len(key), key))
    values = []
    for name in names:
        chosen = [s.distances for s, key in zip(sightings, keys, strict=True) if key == name and s.kept]
        values.append(float(np.sqrt(np.mean(np.square(chosen)))) if chosen else 0.0)
    axes.bar(range(len(names)), values, color=[css(BLUE)] * len(names), width=0.7)
    named = len(names) <= _MOST_NAMES
    axes.set_xlabel(f"{label} (coloured: left out)" if named and 0.0 in values else label)
    axes.set_ylabel("RMS residual [px]")
    axes.grid(axis="x", visible=False)
    if named:
        axes.set_xticks(range(len(names)), names, rotation=90, fontsize=SMALL - 3.0)
        for tick, value in zip(axes.get_xticklabels(), values, strict=True):
            tick.set_color(css(VERMILLION) if value == 0.0 else "black")
    else:
        axes.set_xticks([])
