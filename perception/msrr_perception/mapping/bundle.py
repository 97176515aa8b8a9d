"""The equations of bundle adjustment: the corners of all tags in all views, projected, with derivatives.

Every pose moves away from where it was by a rotation vector w and a shift d: ``R = exp(w) R0``, ``p = p0 +
d``. The reference tag does not move; without it the map could be anywhere. Sources: B. Triggs et al.,
"Bundle adjustment, a modern synthesis", Vision Algorithms, 1999; J. Sola et al., "A micro Lie theory", 2018.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners

#: What an adjustment may change of a lens, in this order: focal length, principal point [px], k1, k2.
LENS_ENTRIES = ("focal_px", "cx_px", "cy_px", "k1", "k2")

#: Least depth of a corner that a camera can have seen, over the edge of the tags: a step of the solver may
#: carry one behind it.
NEAREST = 0.1


@dataclass(frozen=True, eq=False)
class Sightings:
    """Tags that were detected in pictures.

    Attributes:
        view: Index of the picture of each of the N sightings, shape (N,).
        tag: Index of the tag, shape (N,).
        corners: Corners in pixels of the picture, shape (N, 4, 2), in the order of ``tag_corners``.
    """

    view: NDArray[np.intp]
    tag: NDArray[np.intp]
    corners: Array

    def __len__(self) -> int:
        return len(self.view)

    def of(self, chosen: NDArray[np.bool_]) -> Sightings:
        """Return the chosen ones, shape (N,)."""
        return Sightings(self.view[chosen], self.tag[chosen], self.corners[chosen])


@dataclass(frozen=True, eq=False)
class Bundle:
    """The poses of all views and tags, and the lens.

    Attributes:
        lens: Lens of all pictures.
        R_CM: Rotations of the map's frame M in every camera frame C, shape (V, 3, 3).
        p_CM: Its places, shape (V, 3) [m].
        R_MT: Rotations of the tags in M, shape (T, 3, 3).
        p_MT: Their places, shape (T, 3) [m].
        reference: Index of the tag that does not move.
        tag_size: Edge of the black square of every tag [m].
        refines_lens: Whether the lens is adjusted, too.
    """

    lens: Lens
    R_CM: Array
    p_CM: Array
    R_MT: Array
    p_MT: Array
    reference: int
    tag_size: float
    refines_lens: bool = False

    @property
    def views(self) -> int:
        """Number of views."""
        return len(self.p_CM)

    @property
    def tags(self) -> int:
        """Number of tags."""
        return len(self.p_MT)

    @cached_property
    def tag_columns(self) -> NDArray[np.intp]:
        """First variable of every tag, shape (T,); that of the reference is beyond the last variable."""
        order = np.arange(self.tags) - (np.arange(self.tags) > self.reference)
        columns = 6 * (self.views + order)
        columns[self.reference] = self.variables
        return columns

    @cached_property
    def lens_column(self) -> int:
        """First variable of the lens; beyond the last variable if the lens stays as it is."""
        return 6 * (self.views + self.tags - 1)

    @cached_property
    def variables(self) -> int:
        """Number n of variables: (w, d) of every view and every tag but the reference, then the lens."""
        return self.lens_column + (len(LENS_ENTRIES) if self.refines_lens else 0)

    def X_MT(self, tag: int) -> SE3:
        """Return the pose of a tag in the map."""
        return SE3(self.R_MT[tag], self.p_MT[tag])

    def X_CM(self, view: int) -> SE3:
        """Return the pose of the map in a camera frame."""
        return SE3(self.R_CM[view], self.p_CM[view])

    def referred_to(self, tag: int) -> Bundle:
        """Return the same poses with a tag's frame as the map's, by the index of that tag."""
        R, p = self.R_MT[tag], self.p_MT[tag]
        return replace(
            self,
            R_CM=self.R_CM @ R,
            p_CM=self.p_CM + self.R_CM @ p,
            R_MT=R.T @ self.R_MT,
            p_MT=(self.p_MT - p) @ R,
            reference=tag,
        )

    def moved(self, step: Array) -> Bundle:
        """Return the bundle after a step of its variables, shape (n,)."""
        end = 6 * self.views
        view = step[:end].reshape(-1, 6)
        tag = np.insert(step[end : self.lens_column].reshape(-1, 6), self.reference, 0.0, axis=0)
        return replace(
            self,
            lens=self._moved_lens(step),
            R_CM=Rotation.from_rotvec(view[:, :3]).as_matrix() @ self.R_CM,
            p_CM=self.p_CM + view[:, 3:],
            R_MT=Rotation.from_rotvec(tag[:, :3]).as_matrix() @ self.R_MT,
            p_MT=self.p_MT + tag[:, 3:],
        )

    def residuals(self, seen: Sightings) -> Array:
        """Return projected minus detected corners, shape (8 N,) [px]."""
        _, plane = self._on_plane(self.corners_C(seen))
        return np.asarray((self._pixels(self.lens.distortion.apply(plane)) - seen.corners).ravel())

    def jacobian(self, seen: Sightings) -> csr_array:
        """Return the derivatives of :meth:`residuals` by a step of the variables, shape (8 N, n)."""
        corners_C = self.corners_C(seen)
        by_point, by_lens = self._slopes(corners_C)
        by_place = by_point @ self.R_CM[seen.view, np.newaxis]
        turn_view = -by_point @ _hat(corners_C - self.p_CM[seen.view, np.newaxis])
        turn_tag = -by_place @ _hat(self._corners_from_tag(seen))
        blocks = [
            (6 * seen.view, np.concatenate([turn_view, by_point], axis=-1)),
            (self.tag_columns[seen.tag], np.concatenate([turn_tag, by_place], axis=-1)),
            (np.full(len(seen), self.lens_column), by_lens),
        ]
        return self._assembled(blocks)

    def _assembled(self, blocks: list[tuple[NDArray[np.intp], Array]]) -> csr_array:
        """Return a sparse matrix of blocks of rows: first columns, shape (N,), values, shape (N, 4, 2, c).

        Blocks beyond the last variable are left out.
        """
        rows, columns, values = [], [], []
        for first, block in blocks:
            inside = np.flatnonzero(first < self.variables)
            place = np.arange(8 * len(first)).reshape(-1, 4, 2, 1)[inside]
            column = first[inside, np.newaxis, np.newaxis, np.newaxis] + np.arange(block.shape[-1])
            shape = (len(inside), *block.shape[1:])
            rows.append(np.broadcast_to(place, shape).ravel())
            columns.append(np.broadcast_to(column, shape).ravel())
            values.append(block[inside].ravel())
        indices = (np.concatenate(rows), np.concatenate(columns))
        return csr_array((np.concatenate(values), indices), shape=(8 * len(blocks[0][0]), self.variables))

    def _moved_lens(self, step: Array) -> Lens:
        if not self.refines_lens:
            return self.lens
        focal, cx, cy, k1, k2 = step[self.lens_column :].tolist()
        camera, distortion = self.lens.camera, self.lens.distortion
        offset = (camera.offset[0] + cx, camera.offset[1] + cy)
        return Lens(
            replace(camera, focal=camera.focal + focal, offset=offset),
            replace(distortion, k1=distortion.k1 + k1, k2=distortion.k2 + k2),
        )

    def _corners_from_tag(self, seen: Sightings) -> Array:
        """Return the corners of the tags from the middles of the tags, in M, shape (N, 4, 3) [m]."""
        return np.asarray(tag_corners(self.tag_size) @ self.R_MT[seen.tag].swapaxes(1, 2))

    def corners_C(self, seen: Sightings) -> Array:
        """Return the corners of the tags in the cameras that saw them, shape (N, 4, 3) [m]."""
        corners_M = self._corners_from_tag(seen) + self.p_MT[seen.tag, np.newaxis]
        rotated = corners_M @ self.R_CM[seen.view].swapaxes(1, 2)
        return np.asarray(rotated + self.p_CM[seen.view, np.newaxis])

    def _on_plane(self, corners_C: Array) -> tuple[Array, Array]:
        """Return the depths (N, 4) of corners [m], and where they are on the plane at depth 1 (4 N, 2)."""
        z = np.maximum(corners_C[..., 2], NEAREST * self.tag_size)
        return z, (corners_C[..., :2] / z[..., np.newaxis]).reshape(-1, 2)

    def _pixels(self, shown: Array) -> Array:
        """Return the pixels (N, 4, 2) of points of the distorted plane (4 N, 2)."""
        camera = self.lens.camera
        return np.asarray((camera.focal * shown + [camera.cx, camera.cy]).reshape(-1, 4, 2))

    def _slopes(self, corners_C: Array) -> tuple[Array, Array]:
        """Return the derivatives of pixels by the corners and by the lens, shape (N, 4, 2, 3 or 5)."""
        camera, distortion = self.lens.camera, self.lens.distortion
        z, plane = self._on_plane(corners_C)
        shown = distortion.apply(plane)
        by_plane = camera.focal * distortion.jacobian(plane).reshape(*z.shape, 2, 2)
        plane_by_point = np.zeros((*z.shape, 2, 3))
        plane_by_point[..., 0, 0] = plane_by_point[..., 1, 1] = 1.0 / z
        plane_by_point[..., 2] = -plane.reshape(*z.shape, 2) / z[..., np.newaxis]
        by_lens = np.zeros((len(plane), 2, len(LENS_ENTRIES)))
        by_lens[:, :, 0] = shown
        by_lens[:, 0, 1] = by_lens[:, 1, 2] = 1.0
        r2 = (plane**2).sum(axis=1, keepdims=True)
        by_lens[:, :, 3] = camera.focal * r2 * plane * [1.0, distortion.aspect]
        by_lens[:, :, 4] = r2 * by_lens[:, :, 3]
        return by_plane @ plane_by_point, by_lens.reshape(*z.shape, 2, len(LENS_ENTRIES))


def _hat(vectors: Array) -> Array:
    """Return the matrices of the cross products with vectors, shapes (..., 3) and (..., 3, 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=-1).reshape(*vectors.shape, 3)
