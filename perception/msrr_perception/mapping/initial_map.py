"""A first guess of all poses, from the poses that single tags allow, one view after the other.

A single flat tag allows two poses. Which of them is right shows where several tags appear in several views:
a view takes the pose, of all that its tags allow, at which the placed tags appear where they were detected,
and a tag the pose at which the placed views saw it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_perception.mapping.bundle import NEAREST, Bundle, Sightings
from msrr_perception.pose.square_poses import square_poses
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.unit_geometry import tag_corners

#: Distance of a corner from where it was detected above which it counts as much as at this distance [px]: it
#: tells that something is wrong, and no longer how much.
_FAR_PX = 20.0

#: Rotation from which on a pose is another one of the two that a tag allows, and not a better one [rad].
OTHER_RAD = math.radians(8.0)

#: Mean distance of corners up to which another pose is worth an adjustment [px]: where the two poses of a tag
#: can be taken for each other, its corners are at nearly the same pixels in both.
_NEAR_PX = 8.0

#: Number of views of a tag up to which it is placed again with each of them.
_FEW_VIEWS = 8

#: Most rounds over all tags and views after the last view is placed; they end when nothing changes.
_ROUNDS = 10


def initial_bundle(seen: Sightings, lens: Lens, tag_size: float) -> Bundle:
    """Return poses near those that explain all sightings, which have to be connected.

    All pictures have one lens, and the black squares of all tags one edge, ``tag_size`` [m].
    """
    guess = _Guess(seen, lens, tag_size)
    guess.grow()
    guess.settle()
    return Bundle(
        lens=lens,
        R_CM=guess.views[:, :3, :3],
        p_CM=guess.views[:, :3, 3],
        R_MT=guess.tags[:, :3, :3],
        p_MT=guess.tags[:, :3, 3],
        reference=guess.first,
        tag_size=tag_size,
    )


def alternatives(
    bundle: Bundle, seen: Sightings, views: NDArray[np.intp], tags: NDArray[np.intp]
) -> Iterator[Bundle]:
    """Yield bundles in which a view or a tag has the other one of the poses that single tags allow.

    ``views`` and ``tags`` are the indices of those that are turned over, one at a time.
    """
    guess = _Guess(seen, bundle.lens, bundle.tag_size)
    for tag in tags:
        # The pose of the reference is the frame of the map, so that another one has to be the reference.
        base = bundle.referred_to(int(np.flatnonzero(np.arange(bundle.tags) != tag)[0]))
        guess.take(base)
        X = guess.other_tag_pose(int(tag))
        if X is not None:
            R, p = base.R_MT.copy(), base.p_MT.copy()
            R[tag], p[tag] = X[:3, :3], X[:3, 3]
            yield replace(base, R_MT=R, p_MT=p)
    guess.take(bundle)
    for view in views:
        X = guess.other_view_pose(int(view))
        if X is not None:
            R, p = bundle.R_CM.copy(), bundle.p_CM.copy()
            R[view], p[view] = X[:3, :3], X[:3, 3]
            yield replace(bundle, R_CM=R, p_CM=p)


def _pose(w: cv2.typing.MatLike, p: cv2.typing.MatLike) -> Array:
    """Return the matrix of a pose by rotation vector and place, shapes (3, 1) and (4, 4)."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = cv2.Rodrigues(w)[0], p.ravel()
    return X


def _turned(poses: Array, X: Array) -> NDArray[np.bool_]:
    """Return which of some poses, shape (K, 4, 4), are turned against one, shape (4, 4)."""
    cosine = 0.5 * (np.einsum("kij,ij->k", poses[:, :3, :3], X[:3, :3]) - 1.0)
    return np.asarray(cosine < math.cos(OTHER_RAD))


class _Guess:
    """The poses that are placed so far, in the frame of the tag that was placed first.

    Attributes:
        first: Index of that tag, of which one pose is by far the better one in some view.
        views: Poses X_CM, shape (V, 4, 4).
        tags: Poses X_MT, shape (T, 4, 4).
    """

    def __init__(self, seen: Sightings, lens: Lens, tag_size: float) -> None:
        self._seen, self._lens = seen, lens
        self._nearest = NEAREST * tag_size
        self._square = np.column_stack([tag_corners(tag_size), np.ones(4)])
        self._ideal = lens.undistorted(seen.corners)
        found = [square_poses(lens.camera, corners, tag_size) for corners in self._ideal]
        self._X_CT = np.array([[X_CT.matrix() for X_CT, _ in poses] for poses in found])  # (N, 2, 4, 4)
        errors = np.array([[error for _, error in poses] for poses in found])
        self._of_view = [np.flatnonzero(seen.view == v) for v in range(seen.view.max() + 1)]
        self._of_tag = [np.flatnonzero(seen.tag == t) for t in range(seen.tag.max() + 1)]
        self.views = np.tile(np.eye(4), (len(self._of_view), 1, 1))
        self.tags = np.tile(np.eye(4), (len(self._of_tag), 1, 1))
        self.first = int(seen.tag[(errors[:, 1] - errors[:, 0]).argmax()])
        self._placed_view = np.zeros(len(self._of_view), dtype=np.bool_)
        self._placed_tag = np.zeros(len(self._of_tag), dtype=np.bool_)

    def grow(self) -> None:
        """Place all views and tags, one after the other."""
        self._placed_tag[self.first] = True
        while not self._placed_view.all():
            left: list[int] = np.flatnonzero(~self._placed_view).tolist()
            view = max(left, key=self._known_tags)
            self._placed_view[view] = True
            self._place_view(view)
            for tag in self._seen.tag[self._of_view[view]]:
                if self._may_have_moved(tag):
                    self._place_tag(tag)
            self._place_view(view)

    def _may_have_moved(self, tag: int) -> bool:
        """Return whether a tag is to be placed again now that one more of its views is placed.

        The cost grows with the square of the number of its views, of which many that agree tell little more:
        it is placed again while they are few, and then whenever they have doubled.
        """
        views = int(self._placed_view[self._seen.view[self._of_tag[tag]]].sum())
        return not self._placed_tag[tag] or views <= _FEW_VIEWS or views.bit_count() == 1

    def settle(self) -> None:
        """Place all tags and views again until nothing changes: later views tell more about earlier tags."""
        everything = np.arange(len(self._seen))
        before = np.inf
        for _ in range(_ROUNDS):
            X_CT = self.views[self._seen.view] @ self.tags[self._seen.tag]
            total = self._error(X_CT, everything).sum()
            if not total < before:
                return
            before = total
            for tag in range(len(self.tags)):
                self._place_tag(tag)
            for view in range(len(self.views)):
                self._place_view(view)

    def take(self, bundle: Bundle) -> None:
        """Take the poses of a bundle, all of which are placed."""
        for poses, R, p in ((self.views, bundle.R_CM, bundle.p_CM), (self.tags, bundle.R_MT, bundle.p_MT)):
            poses[:, :3, :3], poses[:, :3, 3] = R[: len(poses)], p[: len(poses)]

    def other_tag_pose(self, tag: int) -> Array | None:
        """Return the best of the poses of a tag that differ from its own, (4, 4), if it is near."""
        which = self._of_tag[tag]
        views, allowed = self._allowed_of_tag(which)
        others = allowed[_turned(allowed, self.tags[tag])]
        return self._least(others, self._error(views @ others[:, np.newaxis], which))

    def other_view_pose(self, view: int) -> Array | None:
        """Return the best of the poses of a view that differ from its own, (4, 4), if it is near."""
        which = self._of_view[view]
        tags, allowed = self._allowed_of_view(which)
        others = allowed[_turned(allowed, self.views[view])]
        return self._least(others, self._error(others[:, np.newaxis] @ tags, which))

    def _allowed_of_tag(self, which: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return the views of n sightings of a tag, (n, 4, 4), and the poses X_MT that they allow."""
        views = self.views[self._seen.view[which]]
        return views, (np.linalg.inv(views)[:, np.newaxis] @ self._X_CT[which]).reshape(-1, 4, 4)

    def _allowed_of_view(self, which: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return the tags of n sightings in a view, (n, 4, 4), and the poses X_CM that they allow."""
        tags = self.tags[self._seen.tag[which]]
        return tags, (self._X_CT[which] @ np.linalg.inv(tags)[:, np.newaxis]).reshape(-1, 4, 4)

    def _least(self, poses: Array, errors: Array) -> Array | None:
        """Return the pose with the least of the errors, shape (K, n), if all of its tags are near."""
        if not len(poses) or errors.mean(axis=1).min() > len(self._square) * _NEAR_PX:
            return None
        return np.asarray(poses[errors.mean(axis=1).argmin()])

    def _known_tags(self, view: int) -> tuple[int, int]:
        tags = self._seen.tag[self._of_view[view]]
        return int(self._placed_tag[tags].sum()), len(tags)

    def _place_view(self, view: int) -> None:
        which = self._of_view[view][self._placed_tag[self._seen.tag[self._of_view[view]]]]
        tags, allowed = self._allowed_of_view(which)
        best = self._best_view(np.concatenate([self.views[view, np.newaxis], allowed]), which)
        corners_M = (self._square @ tags.swapaxes(1, 2))[..., :3].reshape(-1, 3)
        corners = self._ideal[which].reshape(-1, 2)
        start = cv2.Rodrigues(best[:3, :3])[0], best[:3, 3].copy()
        refined = cv2.solvePnPRefineLM(corners_M, corners, self._lens.camera.matrix(), np.zeros(4), *start)
        self.views[view] = self._best_view(np.stack([best, _pose(*refined)]), which)

    def _best_view(self, X_CM: Array, which: NDArray[np.intp]) -> Array:
        """Return that of some poses of a view, shape (K, 4, 4), at which its tags appear as detected."""
        errors = self._error(X_CM[:, np.newaxis] @ self.tags[self._seen.tag[which]], which).sum(axis=1)
        return np.asarray(X_CM[errors.argmin()])

    def _place_tag(self, tag: int) -> None:
        which = self._of_tag[tag][self._placed_view[self._seen.view[self._of_tag[tag]]]]
        views, allowed = self._allowed_of_tag(which)
        X_MT = np.concatenate([self.tags[tag, np.newaxis], allowed]) if self._placed_tag[tag] else allowed
        errors = self._error(views @ X_MT[:, np.newaxis], which).sum(axis=1)
        self.tags[tag], self._placed_tag[tag] = X_MT[errors.argmin()], True

    def _error(self, X_CT: Array, which: NDArray[np.intp]) -> Array:
        """Return how far off tags at poses, shape (..., n, 4, 4), would be seen, shape (..., n) [px]."""
        corners_C = (self._square @ X_CT.swapaxes(-1, -2))[..., :3]
        behind = corners_C[..., 2] < self._nearest
        corners_C[behind] = [0.0, 0.0, 1.0]
        distance = np.linalg.norm(self._lens.camera.project(corners_C) - self._ideal[which], axis=-1)
        error: Array = np.where(behind, _FAR_PX, np.minimum(distance, _FAR_PX)).sum(axis=-1)
        return error
