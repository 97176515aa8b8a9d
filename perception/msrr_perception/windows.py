"""Which pixels to ask for: windows around the tags expected in view, as small as the prediction allows.

Pixels rendered and searched are the main cost of perception in the loop, so a near target gets one window per
tag and a far one a window for all. Windows start and end at multiples of 4 px, the tile of the detector's
threshold, so that a tag is seen alike in a window and in the full frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrr_perception.tag_camera import NEAREST_M, pose_vector, project_with_jacobian
from msrr_perception.target import TargetModel
from msrr_scenes.messages import Array, PoseEstimate
from msrr_scenes.pinhole import Window
from msrr_scenes.se3 import SE3

_TILE = 4


@dataclass(frozen=True, slots=True)
class WindowPolicy:
    """How windows are cut.

    Attributes:
        sigmas: How many standard deviations of the prediction a window leaves to a corner.
        margin_px: Room on top of that, for lens blur and the detector's tiles.
        quiet_zone: Room for the tag's white border, as a share of its longest edge in the image.
        merge_px: Windows are joined when that adds fewer pixels than this; the fixed cost of a window.
        extra_px: Windows of tags on neighbouring ports are taken along while all stay below this area.
        budget_px: When the tags of the target port need more than this, a frame looks at some of them and the
            next frame at others.
        least_edge_px: A tag whose shortest edge appears smaller is not expected to be read.
    """

    sigmas: float = 4.0
    margin_px: float = 6.0
    quiet_zone: float = 0.08
    merge_px: int = 2000
    extra_px: int = 8000
    budget_px: int = 20000
    least_edge_px: float = 10.0


#: What suits the markers of the design at 640 x 480.
DEFAULT_POLICY = WindowPolicy()


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedTag:
    """A tag that should be in view.

    Attributes:
        tag_id: The tag.
        pixels: Its corners, shape (4, 2).
        sigma: Standard deviation of each corner coordinate by the prediction, shape (4, 2) [px].
    """

    tag_id: int
    pixels: Array
    sigma: Array

    def box(self, policy: WindowPolicy, widen: float = 1.0) -> Window:
        """Return the pixels that should hold the tag; ``widen`` scales all its margins."""
        edges = np.sqrt(((self.pixels - self.pixels[[3, 0, 1, 2]]) ** 2).sum(axis=1))
        room = widen * (
            policy.sigmas * self.sigma + policy.margin_px + policy.quiet_zone * float(edges.max())
        )
        return Window.around(np.concatenate([self.pixels - room, self.pixels + room]), 0.0)


def expected_tags(
    target: TargetModel, prediction: PoseEstimate, policy: WindowPolicy = DEFAULT_POLICY
) -> tuple[ExpectedTag, ...]:
    """Return the tags that face the camera, wholly inside the image and large enough, by ascending id.

    What other bodies may hide is not known here; a tag that is hidden is simply not found.
    """
    X_CD = target.X_CU @ SE3.from_se2(prediction.X_DU).inverse()
    p_C = X_CD.act(target.all_corners_D)  # (tags, 4, 3)
    seen = (p_C[:, :, 2].min(axis=1) >= NEAREST_M) & _face_camera(p_C)
    if not seen.any():
        return ()
    tags = [tag for tag, shown in zip(target.tags, seen.tolist(), strict=True) if shown]
    flat, J = project_with_jacobian(
        target, pose_vector(prediction.X_DU), target.all_corners_D[seen].reshape(-1, 3)
    )
    pixels = flat.reshape(-1, 4, 2)
    edges = np.sqrt(((pixels - pixels[:, [3, 0, 1, 2]]) ** 2).sum(axis=2))
    low, high = pixels.min(axis=1), pixels.max(axis=1)
    fits = (
        (low >= -0.5).all(axis=1)
        & (high <= [target.camera.width - 0.5, target.camera.height - 0.5]).all(axis=1)
        & (edges.min(axis=1) >= policy.least_edge_px)
    )
    J_pose = J[:, :3]
    variance = ((J_pose @ prediction.covariance) * J_pose).sum(axis=1)
    sigma = np.sqrt(np.maximum(variance, 0.0)).reshape(-1, 4, 2)
    return tuple(ExpectedTag(tag, pixels[i], sigma[i]) for i, tag in enumerate(tags) if fits[i])


def choose_tags(
    target: TargetModel, expected: Sequence[ExpectedTag], turn: int, policy: WindowPolicy = DEFAULT_POLICY
) -> tuple[ExpectedTag, ...]:
    """Return the tags worth looking at in one frame.

    Tags of the target port come first (others when none of them is expected). When they are so near that
    their windows exceed the budget, as many as fit take turns, at least one a frame; when they are so far
    that there is room, tags of neighbouring ports are taken along.

    Args:
        target: Camera and map of the tags.
        expected: What should be in view.
        turn: Number of the frame; says who is first.
        policy: Budget and room.
    """
    own = [e for e in expected if e.tag_id in target.port_tags]
    others = [e for e in expected if e.tag_id not in target.port_tags]
    first = own or others
    if not first:
        return ()
    start = turn % len(first)
    chosen: list[ExpectedTag] = []
    taken: tuple[Window, ...] = ()

    def take(tag: ExpectedTag, room_px: float) -> tuple[Window, ...]:
        """Take a tag if there is room; return the windows that hold all tags taken so far."""
        more = merged_windows([*taken, tag.box(policy)], target.camera.frame, policy)
        if sum(w.area for w in more) > room_px:
            return taken
        chosen.append(tag)
        return more

    for tag in [*first[start:], *first[:start]]:
        taken = take(tag, policy.budget_px if chosen else math.inf)
    if own and len(chosen) == len(own):
        for extra in others:
            taken = take(extra, policy.extra_px)
    return tuple(sorted(chosen, key=lambda e: e.tag_id))


def plan_windows(
    target: TargetModel,
    tags: Sequence[ExpectedTag],
    policy: WindowPolicy = DEFAULT_POLICY,
    widen: float = 1.0,
) -> tuple[Window, ...]:
    """Return the windows that hold ``tags``, ordered by place in the image; ``widen`` scales margins."""
    return merged_windows((e.box(policy, widen) for e in tags), target.camera.frame, policy)


def fitting_window(window: Window, frame: Window) -> Window | None:
    """Return ``window`` grown to whole tiles and cut to ``frame``; None when they have no pixel in common."""
    x, y = math.floor(window.x / _TILE) * _TILE, math.floor(window.y / _TILE) * _TILE
    x_end, y_end = math.ceil(window.x_end / _TILE) * _TILE, math.ceil(window.y_end / _TILE) * _TILE
    return Window(x, y, x_end - x, y_end - y).intersection(frame)


def merged_windows(boxes: Iterable[Window], frame: Window, policy: WindowPolicy) -> tuple[Window, ...]:
    """Return the boxes cut to the frame, with those joined that are cheaper to look at as one."""
    fitted = (fitting_window(box, frame) for box in boxes)
    windows = [w for w in fitted if w is not None]
    while True:
        best: tuple[int, int, int] | None = None
        for i, a in enumerate(windows):
            for j in range(i + 1, len(windows)):
                b = windows[j]
                x, y = min(a.x, b.x), min(a.y, b.y)
                joined = (max(a.x_end, b.x_end) - x) * (max(a.y_end, b.y_end) - y)
                added = joined - a.area - b.area
                if added < policy.merge_px and (best is None or added < best[0]):
                    best = (added, i, j)
        if best is None:
            return tuple(sorted(windows, key=lambda w: (w.x, w.y)))
        _, i, j = best
        both = _union(windows[i], windows[j])
        windows = [*(w for k, w in enumerate(windows) if k not in (i, j)), both]


def _union(a: Window, b: Window) -> Window:
    x, y = min(a.x, b.x), min(a.y, b.y)
    return Window(x, y, max(a.x_end, b.x_end) - x, max(a.y_end, b.y_end) - y)


def _face_camera(p_C: Array) -> NDArray[np.bool_]:
    """Say of which tags, corners (tags, 4, 3), the printed side is seen: z of T points into the tag."""
    a, b = p_C[:, 1] - p_C[:, 0], p_C[:, 0] - p_C[:, 3]
    normal = a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
    seen: NDArray[np.bool_] = (normal * p_C.sum(axis=1)).sum(axis=1) > 0.0
    return seen


def pose_is_known(prediction: PoseEstimate, position_m: float, yaw: float) -> bool:
    """Say whether every direction of the prediction is known better than ``position_m`` and ``yaw`` [rad]."""
    P = prediction.covariance
    largest = float(np.linalg.eigvalsh(P[:2, :2])[-1])
    return largest < position_m**2 and float(P[2, 2]) < yaw**2
