"""The choice of pixel windows around the tags expected in view, as small as the prediction allows.

Pixels rendered and searched are the main cost of perception in the loop, so a near target gets one window per
tag and a far one a window for all. Windows start and end at multiples of 4 px, the tile of the detector's
threshold, so that a tag looks the same to it in a window and in the full frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from msrr_perception.kernels.project import predict_tags, tag_extent
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import PoseEstimate
from msrr_scenes.specs.tag_families import TAG36H11, TagFamily

#: Edge of the tiles of the detector's threshold [px].
_TILE = 4

#: Factor on a window's margins when it is read a second time.
RETRY_WIDEN = 2.5


@dataclass(frozen=True, slots=True)
class WindowPolicy:
    """The rules by which windows are cut.

    Attributes:
        sigmas: Margin of a corner in standard deviations of the prediction.
        margin_px: Additional margin for lens blur and the detector's tiles [px].
        quiet_zone: Margin for the tag's white border, as a share of its longest edge in the image.
        merge_px: Fixed cost of a window: two are joined when that adds fewer pixels than this [px].
        extra_px: Total area up to which tags of neighbouring ports are read as well [px].
        budget_px: Total area above which the tags of the target port take turns from frame to frame [px].
        least_edge_px: Shortest edge in the image with which a tag is expected to be read [px].
    """

    sigmas: float = 4.0
    margin_px: float = 6.0
    quiet_zone: float = 0.08
    merge_px: int = 2000
    extra_px: int = 8000
    budget_px: int = 20000
    least_edge_px: float = 10.0

    def for_family(self, family: TagFamily) -> WindowPolicy:
        """Return these rules for a family, whose print may reach farther beyond the tag."""
        more = 0.5 * (family.plate_ratio - TAG36H11.plate_ratio)
        return replace(self, quiet_zone=self.quiet_zone + more) if more else self


#: The policy for the markers of the design at 640 x 480.
DEFAULT_POLICY = WindowPolicy()


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedTag:
    """A tag that should be in view.

    Attributes:
        tag_id: Id of the tag.
        pixels: Predicted corners in the frame, shape (4, 2) [px].
        sigma: Standard deviation of each corner coordinate, shape (4, 2) [px].
    """

    tag_id: int
    pixels: Array
    sigma: Array

    def window(self, policy: WindowPolicy, widen: float = 1.0) -> Window:
        """Return the window that should hold the tag; ``widen`` scales all margins."""
        x, y, x_end, y_end = tag_extent(
            self.pixels, self.sigma, policy.sigmas, policy.margin_px, policy.quiet_zone, widen
        )
        return Window(x, y, x_end - x, y_end - y)

    @property
    def upright_edge(self) -> float:
        """Shortest edge that an upright tag would have which is as hard to read in fewer pixels [px].

        A tag that is turned by an angle needs more pixels, in proportion to ``|cos| + |sin|`` of it.
        """
        corners, shortest = self.pixels.tolist(), math.inf
        for (au, av), (bu, bv) in zip(corners, corners[1:] + corners[:1], strict=True):
            du, dv = abs(bu - au), abs(bv - av)
            shortest = min(shortest, (du * du + dv * dv) / max(du + dv, 1e-9))
        return shortest


def expected_tags(
    target: TargetModel, prediction: PoseEstimate, policy: WindowPolicy = DEFAULT_POLICY
) -> tuple[ExpectedTag, ...]:
    """Return the tags that face the camera, lie inside the image and are large enough, by ascending id.

    Bodies that may hide a tag are not considered; a hidden tag is simply not found.
    """
    # The kernel predicts a part of the ideal image from (0, 0) on: here the part that holds all of the frame.
    lens, part = target.lens, target.lens.bounds
    pixels, sigma, expected = predict_tags(
        target.optics_in_bounds,
        part.width,
        part.height,
        pose_vector(prediction.X_DU),
        prediction.covariance,
        target.all_corners_D,
        policy.least_edge_px,
    )
    found = [ExpectedTag(tag, pixels[i], sigma[i]) for i, tag in enumerate(target.tags) if expected[i]]
    if not lens.distorts:
        return tuple(found)
    corner = np.array([part.x, part.y])
    return tags_in_frame([replace(tag, pixels=tag.pixels + corner) for tag in found], lens)


def tags_in_frame(tags: Sequence[ExpectedTag], lens: Lens) -> tuple[ExpectedTag, ...]:
    """Return those tags of the ideal image that the frame shows as a whole, where it shows them."""
    if not tags:
        return ()
    ideal, sigma = np.stack([tag.pixels for tag in tags]), np.stack([tag.sigma for tag in tags])
    shown = np.all(lens.shows(ideal), axis=1)
    pixels, sigma = lens.distorted(ideal), lens.distorted_sigma(ideal, sigma)
    return tuple(ExpectedTag(tag.tag_id, pixels[i], sigma[i]) for i, tag in enumerate(tags) if shown[i])


def choose_tags(
    target: TargetModel, expected: Sequence[ExpectedTag], turn: int, policy: WindowPolicy = DEFAULT_POLICY
) -> tuple[ExpectedTag, ...]:
    """Return the tags to read in the frame of number ``turn``, of those that are expected in view.

    Tags of the target port come first (others when none of them is expected). When they are so near that
    their windows exceed the budget of the policy, as many as fit take turns, at least one a frame; when they
    are so far that area is left, tags of neighbouring ports are read as well.
    """
    own = [e for e in expected if e.tag_id in target.port_tags]
    others = [e for e in expected if e.tag_id not in target.port_tags]
    first = own or others
    if not first:
        return ()
    start = turn % len(first)
    chosen: list[ExpectedTag] = []
    frame = target.camera.frame
    boxes: list[_Box] = []

    def choose(tag: ExpectedTag, largest_px: float) -> list[_Box]:
        """Choose a tag if the area allows it; return the boxes that hold all chosen tags."""
        more = _merged([*boxes, *_fitted(tag.window(policy), frame)], policy.merge_px)
        if sum((x_end - x) * (y_end - y) for x, y, x_end, y_end in more) > largest_px:
            return boxes
        chosen.append(tag)
        return more

    for tag in [*first[start:], *first[:start]]:
        boxes = choose(tag, policy.budget_px if chosen else math.inf)
    if own and len(chosen) == len(own):
        for extra in others:
            boxes = choose(extra, policy.extra_px)
    return tuple(sorted(chosen, key=lambda e: e.tag_id))


def plan_windows(
    frame: Window,
    tags: Iterable[ExpectedTag],
    policy: WindowPolicy = DEFAULT_POLICY,
    widen: float = 1.0,
) -> tuple[Window, ...]:
    """Return the windows of a frame that hold tags, from left to right; ``widen`` scales all margins."""
    fitted = [box for e in tags for box in _fitted(e.window(policy, widen), frame)]
    merged = _merged(fitted, policy.merge_px)
    return tuple(Window(x, y, x_end - x, y_end - y) for x, y, x_end, y_end in merged)


#: First column and row of a window, and those after the last; cheaper than objects in the loops below.
_Box = tuple[int, int, int, int]


def fitting_window(window: Window, frame: Window) -> Window | None:
    """Return ``window`` grown to whole tiles and cut to ``frame``; None when they have no pixel in common."""
    for x, y, x_end, y_end in _fitted(window, frame):
        return Window(x, y, x_end - x, y_end - y)
    return None


def _fitted(window: Window, frame: Window) -> tuple[_Box, ...]:
    """Return the box of ``window`` grown to whole tiles and cut to ``frame``; empty when nothing is left."""
    x, y = max(window.x // _TILE * _TILE, frame.x), max(window.y // _TILE * _TILE, frame.y)
    x_end = min(-(-(window.x + window.width) // _TILE) * _TILE, frame.x + frame.width)
    y_end = min(-(-(window.y + window.height) // _TILE) * _TILE, frame.y + frame.height)
    return ((x, y, x_end, y_end),) if x < x_end and y < y_end else ()


def _merged(boxes: list[_Box], merge_px: int) -> list[_Box]:
    """Join boxes as long as that adds fewer pixels than ``merge_px``, cheapest first; sorted by column."""
    boxes = list(boxes)
    while True:
        least, best = merge_px, None
        for i, (ax, ay, ax_end, ay_end) in enumerate(boxes):
            area = (ax_end - ax) * (ay_end - ay)
            for j in range(i + 1, len(boxes)):
                bx, by, bx_end, by_end = boxes[j]
                x, y = ax if ax < bx else bx, ay if ay < by else by
                x_end, y_end = ax_end if ax_end > bx_end else bx_end, ay_end if ay_end > by_end else by_end
                added = (x_end - x) * (y_end - y) - area - (bx_end - bx) * (by_end - by)
                if added < least:
                    least, best = added, (i, j, (x, y, x_end, y_end))
        if best is None:
            return sorted(boxes)
        i, j, joined = best
        boxes = [*(box for k, box in enumerate(boxes) if k not in (i, j)), joined]


def pose_is_known(prediction: PoseEstimate, position_m: float, yaw: float) -> bool:
    """Return whether all standard deviations lie below ``position_m`` and ``yaw`` [rad]."""
    P = prediction.covariance
    (xx, xy, _), (_, yy, _), (_, _, turn) = P.tolist()
    largest = 0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy)  # eigenvalue of the position's part
    return bool(largest < position_m**2 and turn < yaw**2)
