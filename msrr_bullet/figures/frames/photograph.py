"""Annotated photographs: outline, id and axes of every tag that was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msrr_bullet.figures.drawing.canvas import Canvas, Image, Key, titled
from msrr_bullet.timeline.palette import BLUE, DETECTION, GREEN, ORANGE
from msrr_perception.photographs.tag_finder import FoundTag
from msrr_perception.photographs.tag_poses import TagPose
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.messages import Pixels

#: Width up to which small photographs are enlarged [px].
_WIDTH = 800


@dataclass(frozen=True, eq=False)
class PosedLens:
    """What is needed to draw the axes of tags: the lens, and the length of an axis [m]."""

    lens: Lens
    length: float


def draw_photograph(
    pixels: Pixels,
    title: str,
    tags: Sequence[tuple[FoundTag, Sequence[TagPose]]],
    posed: PosedLens | None = None,
) -> Image:
    """Return a photograph, BGR of shape (height, width, 3), with its tags drawn on it.

    The photograph is mono8 of shape (height, width), and ``title`` a line of text above it. Each tag comes
    with its poses, the best first, and ``posed`` is lens and length of the axes, where there are poses.
    """
    height, width = pixels.shape
    canvas = Canvas(width, height, max(1, _WIDTH // width))
    canvas.paste(pixels, np.ones(pixels.shape, dtype=np.bool_))
    for found, poses in tags:
        corners = found.tag.corners
        canvas.line(corners, DETECTION, 2, closed=True, dashed=not found.refined)
        canvas.dot(corners[0], DETECTION, 3.0)
        if poses and posed is not None:
            _draw_axes(canvas, poses[0], posed)
        top = corners[corners[:, 1].argmin()]
        canvas.text(top, str(found.tag.tag_id), DETECTION)
    legend = [Key(DETECTION, "tag, dot at its lower left"), Key(DETECTION, "edges not measured", dashed=True)]
    if posed is not None:
        legend += [Key(ORANGE, "x"), Key(GREEN, "y"), Key(BLUE, "out of the tag")]
    return titled(canvas.image, [title], legend)


def _draw_axes(canvas: Canvas, pose: TagPose, posed: PosedLens) -> None:
    ends = posed.length * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    in_camera = pose.X_CT.act(ends)
    if (in_camera[:, 2] <= 0.0).any():
        return
    shown = posed.lens.distorted(posed.lens.camera.project(in_camera))
    for end, colour in zip(shown[1:], (ORANGE, GREEN, BLUE), strict=True):
        canvas.line([shown[0], end], colour, 2)
