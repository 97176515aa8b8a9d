"""What the residuals of a map of photographs are made of: more terms of the adjustment, tested by F."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from msrr_perception.mapping.bundle import Bundle, Sightings
from msrr_perception.mapping.mapper import TagMap
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.unit_geometry import tag_corners

#: Singular values below this share of the largest belong to nothing that the pictures tell.
_RANK = 1e-9


@dataclass(frozen=True)
class Term:
    """What one term explains.

    Attributes:
        name: What it stands for.
        numbers: How many numbers of the adjustment it adds.
        sigma_px: Standard deviation of the coordinates of corners that is left [px].
        ratio: What it explains by number, over what is left by number: 1 by chance.
    """

    name: str
    numbers: int
    sigma_px: float
    ratio: float


def terms(found: TagMap) -> list[Term]:
    """Return what several terms explain of the residuals of a map whose lens was refined."""
    bundle, seen = _adjusted(found)
    J, r = bundle.jacobian(seen).toarray(), bundle.residuals(seen)
    size, shape, shutter = _size(bundle, seen), _shape(bundle, seen), _rolling_shutter(bundle, seen)
    base, rank = _left(J, r)
    out = [Term("as it is", 0, math.sqrt(base / (len(r) - rank)), math.nan)]
    for name, more in (
        ("size of every tag", [size]),
        ("shape of every tag: its corners anywhere", [shape]),
        ("a shear by rows of every picture", [shutter]),
        ("shape and shear", [shape, shutter]),
    ):
        left, total = _left(np.hstack([J, *more]), r)
        variance = left / (len(r) - total)
        out.append(Term(name, total - rank, math.sqrt(variance), (base - left) / (total - rank) / variance))
    return out


def _left(J: Array, r: Array) -> tuple[float, int]:
    """Return the sum of squares that is left after a step of the variables, and their rank."""
    step, _, rank, _ = np.linalg.lstsq(J, -r, rcond=_RANK)
    return float(((r + J @ step) ** 2).sum()), int(rank)


def _adjusted(found: TagMap) -> tuple[Bundle, Sightings]:
    names, ids = list(found.X_CM), list(found.tags)
    used = [s for s in found.sightings if s.kept]
    bundle = Bundle(
        found.lens,
        np.stack([X.R for X in found.X_CM.values()]),
        np.stack([X.p for X in found.X_CM.values()]),
        np.stack([t.X_MT.R for t in found.tags.values()]),
        np.stack([t.X_MT.p for t in found.tags.values()]),
        ids.index(found.reference),
        found.tag_size,
        refines_lens=True,
    )
    view = np.array([names.index(s.picture) for s in used])
    tag = np.array([ids.index(s.tag_id) for s in used])
    empty = Sightings(view, tag, np.zeros((len(used), 4, 2)))
    projected = bundle.residuals(empty).reshape(-1, 4, 2)
    return bundle, Sightings(view, tag, projected - np.stack([s.residuals for s in used]))


def _by_corner(bundle: Bundle, seen: Sightings) -> Array:
    """Return the derivatives of the pixels by the corners in the frames of the tags, shape (N, 4, 2, 3)."""
    by_point = bundle.project(bundle.corners_C(seen))[1]
    return np.asarray(by_point @ (bundle.R_CM[seen.view] @ bundle.R_MT[seen.tag])[:, np.newaxis])


def _shape(bundle: Bundle, seen: Sightings) -> Array:
    out = np.zeros((len(seen), 4, 2, bundle.tags, 4, 3))
    for i, slopes in enumerate(_by_corner(bundle, seen)):
        for corner in range(4):
            out[i, corner, :, seen.tag[i], corner] = slopes[corner]
    return out.reshape(8 * len(seen), -1)


def _size(bundle: Bundle, seen: Sightings) -> Array:
    out = np.zeros((len(seen), 4, 2, bundle.tags))
    slopes = np.einsum("nkij,kj->nki", _by_corner(bundle, seen), tag_corners(1.0))
    out[np.arange(len(seen)), :, :, seen.tag] = slopes
    return out.reshape(8 * len(seen), -1)


def _rolling_shutter(bundle: Bundle, seen: Sightings) -> Array:
    """Rows that are exposed one after the other by a camera that turns shear the picture both ways."""
    out = np.zeros((len(seen), 4, 2, bundle.views, 2))
    row = seen.corners[..., 1] / bundle.lens.camera.height - 0.5
    for i, view in enumerate(seen.view):
        out[i, :, 0, view, 0] = out[i, :, 1, view, 1] = row[i]
    return out.reshape(8 * len(seen), -1)
