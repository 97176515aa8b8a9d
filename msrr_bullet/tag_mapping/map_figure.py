"""The 3-D figure of a map: every tag as a square with its id, and where the camera stood."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from msrr_bullet.figures.plots.style import SMALL, new_figure, save, styled
from msrr_bullet.timeline.palette import BLACK, BLUE, ORANGE, css
from msrr_perception.mapping.mapper import TagMap
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import R_BODY_OPTICAL
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.wording import counted

_WIDTH_IN, _HEIGHT_IN = 15.0, 7.5

#: Directions from which the map is seen: elevation and azimuth [deg], and title.
_VIEWS = ((25.0, -120.0, "from the side"), (90.0, -180.0, "from above"))

#: Depth of the drawn pyramid of a camera, by the size of a tag.
_CAMERA_DEPTH = 0.8


def draw_map(tag_map: TagMap, path: Path) -> Path:
    """Draw tags and cameras to a PNG file, in axes that are upright if the reference hangs upright."""
    tags = {
        tag_id: _upright(tag.X_MT.act(tag_corners(tag_map.tag_size))) for tag_id, tag in tag_map.tags.items()
    }
    cameras = [_upright(corners) for corners in _camera_outlines(tag_map)]
    with styled():
        figure = new_figure(_WIDTH_IN, _HEIGHT_IN)
        for i, (elevation, azimuth, title) in enumerate(_VIEWS):
            axes = figure.add_subplot(1, len(_VIEWS), i + 1, projection="3d")
            assert isinstance(axes, Axes3D)
            _draw(axes, tag_map.reference, tags, cameras)
            axes.view_init(elevation, azimuth)
            axes.set_title(title)
            if elevation == 90.0:  # heights lie one upon the other
                axes.set(zticks=[], zlabel="")
        figure.suptitle(
            f"{counted(len(tags), 'tag')}, {counted(len(cameras), 'picture')}; "
            f"metres from tag {tag_map.reference}"
        )
        return save(figure, path)


def _upright(points_M: Array) -> Array:
    """Return points of the map, x right, y down, z into the tag, with x forward, y left, z up."""
    return np.asarray(points_M @ R_BODY_OPTICAL.T)


def _camera_outlines(tag_map: TagMap) -> list[Array]:
    """Return the optical centre of every camera and four corners ahead of it, shape (5, 3) [m]."""
    frame, depth = tag_map.lens.camera.frame, _CAMERA_DEPTH * tag_map.tag_size
    pixels = np.array([[0, 0], [frame.width, 0], [frame.width, frame.height], [0, frame.height]])
    outline_C = np.concatenate([np.zeros((1, 3)), depth * tag_map.lens.camera.rays(pixels)])
    return [X_CM.inverse().act(outline_C) for X_CM in tag_map.X_CM.values()]


def _draw(axes: Axes3D, reference: int, tags: dict[int, Array], cameras: list[Array]) -> None:
    for tag_id, corners in tags.items():
        colour = css(ORANGE if tag_id == reference else BLUE)
        axes.add_collection3d(Poly3DCollection([corners], facecolor=colour, edgecolor=css(BLACK), alpha=0.8))
        axes.text(*corners.mean(axis=0), f" {tag_id}", fontsize=SMALL - 2.0, zorder=10)
    edges = [[c[i], c[j]] for c in cameras for i, j in ((0, 1), (0, 2), (0, 3), (0, 4))]
    edges += [[c[i], c[1 + i % 4]] for c in cameras for i in (1, 2, 3, 4)]
    axes.add_collection3d(Line3DCollection(edges, colors="#6b747d", linewidths=0.7))
    points = np.concatenate([*tags.values(), *cameras])
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    # The layout knows nothing of labels that stand off the box: at its full size one is cut.
    axes.set_box_aspect(np.maximum(high - low, 0.05 * (high - low).max()), zoom=0.85)
    for axis, label in ((axes.xaxis, "into the tag"), (axes.yaxis, "left"), (axes.zaxis, "up")):
        axis.set_label_text(label)
        axis.labelpad = 12.0
    axes.tick_params(labelsize=SMALL - 4.0)
