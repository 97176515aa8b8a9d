"""A map of tags from the tags that were detected in pictures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from msrr_perception.mapping.adjustment import Adjusted, AdjustmentError, adjust_robustly
from msrr_perception.mapping.bundle import Bundle, Sightings
from msrr_perception.mapping.consistency import (
    Consistent,
    Contradiction,
    adjust_consistently,
    largest_connected,
    most_seen_tag,
    near,
)
from msrr_perception.mapping.group_tests import Kind
from msrr_perception.mapping.initial_map import initial_bundle
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import has_inverse
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import TagDetection

#: Order of ROS (place, then rotation) of the variables of a tag (rotation, then shift).
_ROS_ORDER = np.array([3, 4, 5, 0, 1, 2])


@dataclass(frozen=True, eq=False)
class TaggedPicture:
    """A picture by its name, with the tags that were detected in it."""

    name: str
    tags: tuple[TagDetection, ...]


@dataclass(frozen=True, eq=False)
class MappedTag:
    """A tag of a map.

    Attributes:
        X_MT: Its pose.
        covariance: Covariance of place [m] and rotation [rad] about the axes of M, against the reference,
            shape (6, 6). The size of the tags, and a lens that is not refined, are taken to be exact.
        pictures: Number of pictures that tell of it.
        may_be_turned: Angle by which it may be turned as well [rad], which the covariance does not count: the
            pictures show a flat tag there nearly as they show it here. None if they tell which is right.
    """

    X_MT: SE3
    covariance: Array
    pictures: int
    may_be_turned: float | None = None

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the place, root of the sum over the axes [m]."""
        return math.sqrt(float(np.trace(self.covariance[:3, :3])))

    @property
    def sigma_rad(self) -> float:
        """Standard deviation of the rotation, root of the sum over the axes [rad]."""
        return math.sqrt(float(np.trace(self.covariance[3:, 3:])))


@dataclass(frozen=True, eq=False)
class MappedSighting:
    """A tag in a picture against the map.

    Attributes:
        picture: Name of the picture.
        tag_id: Id of the tag.
        residuals: Projected minus detected corners, shape (4, 2) [px]; NaN without tag or picture in M.
        edge_px: Mean length of the edges of the tag in the picture [px].
        angle: Angle between the line of sight and the normal of the tag [rad].
        kept: Whether the map is made of it.
    """

    picture: str
    tag_id: int
    residuals: Array
    edge_px: float
    angle: float
    kept: bool

    @property
    def distances(self) -> Array:
        """Distances of the corners, shape (4,) [px]."""
        return np.asarray(np.hypot(self.residuals[:, 0], self.residuals[:, 1]))


@dataclass(frozen=True)
class LeftOut:
    """What contradicts the rest of the pictures and was left out.

    Attributes:
        kind: Whether it is one sighting, all of a tag, or all of a picture.
        tags: Ids of its tags.
        pictures: Names of its pictures.
        rms_px: Root mean square of the distances of its corners from where the rest has them [px].
        score: How unlikely it is, as the quantile of a standard normal distribution.
    """

    kind: Kind
    tags: tuple[int, ...]
    pictures: tuple[str, ...]
    rms_px: float
    score: float


@dataclass(frozen=True, eq=False)
class TagMap:
    """Where tags are, in the frame M of the tag that was seen most often.

    Attributes:
        reference: Id of that tag.
        tag_size: Edge of the black square of the tags [m].
        tags: The tags by their ids, ascending.
        X_CM: Pose of the map in the camera of every picture that was used, by its name.
        sightings: All tags in all pictures, also those that were left out.
        left_out: What contradicts the rest, the worst first.
        unconnected: Names of pictures that no common tag connects with the map, of what is not left out.
        lens: Lens of the pictures, refined if that was asked for.
        lens_sigma: Standard deviations of its :data:`LENS_ENTRIES`, shape (5,); empty if it was not refined.
        sigma_px: Standard deviation of the coordinates of corners, from the residuals [px].
    """

    reference: int
    tag_size: float
    tags: dict[int, MappedTag]
    X_CM: dict[str, SE3]
    sightings: tuple[MappedSighting, ...]
    left_out: tuple[LeftOut, ...]
    unconnected: tuple[str, ...]
    lens: Lens
    lens_sigma: tuple[float, ...]
    sigma_px: float

    def distances(self) -> Array:
        """Return by how much the corners that were used are off, shape (4 N,) [px]."""
        return np.concatenate([s.distances for s in self.sightings if s.kept])


def map_tags(
    pictures: Sequence[TaggedPicture], lens: Lens, tag_size: float, *, refine_lens: bool = False
) -> TagMap:
    """Return the map of the tags in some pictures, whose order does not matter.

    Args:
        pictures: Tags by picture; names are unique.
        lens: Lens of all pictures, by calibration.
        tag_size: Edge of the black square of the tags [m].
        refine_lens: Whether focal length, principal point, k1 and k2 are adjusted as well.

    Raises:
        AdjustmentError: The pictures do not determine a map.
    """
    seen, names, _ = _sightings(pictures)
    together = largest_connected(seen, np.ones(len(seen), dtype=np.bool_))
    alone = {names[view] for view in seen.view[~together]}
    seen, names, ids = _sightings([p for p in pictures if p.name not in alone])
    if len(ids) < 2:
        raise AdjustmentError(
            f"a map needs pictures that show two tags or more together; tag {ids[0]} was only seen alone"
        )
    bundle = initial_bundle(seen, lens, tag_size)
    part = seen.of(largest_connected(seen, near(bundle, seen)))
    bundle = adjust_robustly(bundle.referred_to(most_seen_tag(part)), part)
    if refine_lens:
        bundle = adjust_robustly(replace(bundle, refines_lens=True), part)
    consistent = adjust_consistently(bundle, seen)
    found = consistent.adjusted.bundle.lens
    if not has_inverse(found.camera, found.distortion):
        raise AdjustmentError("the pictures do not determine the lens; map without refining it")
    told = {i for c in consistent.contradictions for i in c.group.members.tolist()}
    alone |= {names[seen.view[i]] for i in np.flatnonzero(~consistent.kept).tolist() if i not in told}
    return _summary(consistent, seen, names, ids, tuple(sorted(alone)))


def _sightings(pictures: Sequence[TaggedPicture]) -> tuple[Sightings, list[str], list[int]]:
    """Return the sightings, the names of their views and the ids of their tags."""
    found = [(p.name, t) for p in sorted(pictures, key=lambda p: p.name) for t in p.tags]
    if not found:
        raise AdjustmentError("no tag was found in any picture; is the family right?")
    for (name, tag_id), count in Counter((name, tag.tag_id) for name, tag in found).items():
        if count > 1:
            raise AdjustmentError(
                f"{name}: tag {tag_id} is there {count} times; every tag of a map has an id of its own, and "
                "every picture a name"
            )
    for name, tag in found:
        if np.linalg.matrix_rank(tag.corners - tag.corners[0], tol=1e-6) < 2:
            raise AdjustmentError(f"{name}: the corners of tag {tag.tag_id} lie on a line")
    names = sorted({name for name, _ in found})
    ids = sorted({tag.tag_id for _, tag in found})
    seen = Sightings(
        view=np.array([names.index(name) for name, _ in found]),
        tag=np.array([ids.index(tag.tag_id) for _, tag in found]),
        corners=np.array([tag.corners for _, tag in found], dtype=np.float64),
    )
    return seen, names, ids


def _summary(
    consistent: Consistent, seen: Sightings, names: list[str], ids: list[int], alone: tuple[str, ...]
) -> TagMap:
    adjusted, kept = consistent.adjusted, consistent.kept
    bundle = adjusted.bundle
    tags = {ids[tag]: _mapped_tag(consistent, seen.of(kept), tag) for tag in np.unique(seen.tag[kept])}
    sightings = _mapped_sightings(bundle, seen, kept, names, ids)
    return TagMap(
        reference=ids[bundle.reference],
        tag_size=bundle.tag_size,
        tags=tags,
        X_CM={names[view]: bundle.X_CM(view) for view in np.unique(seen.view[kept])},
        sightings=sightings,
        left_out=tuple(_left_out(c, seen, names, ids, sightings) for c in consistent.contradictions),
        unconnected=alone,
        lens=bundle.lens,
        lens_sigma=_lens_sigma(adjusted),
        sigma_px=adjusted.sigma_px,
    )


def _mapped_tag(consistent: Consistent, kept: Sightings, tag: int) -> MappedTag:
    adjusted, bundle = consistent.adjusted, consistent.adjusted.bundle
    covariance = np.zeros((6, 6))
    if tag != bundle.reference:
        covariance = adjusted.sigma_px**2 * adjusted.cofactors(bundle.tag_columns[tag] + _ROS_ORDER)
    pictures, angle = int((kept.tag == tag).sum()), consistent.may_be_turned.get(int(tag))
    return MappedTag(bundle.X_MT(tag), covariance, pictures, angle)


def _mapped_sightings(
    bundle: Bundle, seen: Sightings, kept: NDArray[np.bool_], names: list[str], ids: list[int]
) -> tuple[MappedSighting, ...]:
    residuals = bundle.residuals(seen).reshape(-1, 4, 2)
    placed = np.isin(seen.view, seen.view[kept]) & np.isin(seen.tag, seen.tag[kept])
    residuals[~placed] = np.nan
    edges = np.linalg.norm(seen.corners - np.roll(seen.corners, 1, axis=1), axis=2).mean(axis=1)
    return tuple(
        MappedSighting(
            picture=names[seen.view[i]],
            tag_id=ids[seen.tag[i]],
            residuals=residuals[i],
            edge_px=float(edges[i]),
            angle=_viewing_angle(bundle.X_CM(seen.view[i]) @ bundle.X_MT(seen.tag[i])),
            kept=bool(kept[i]),
        )
        for i in range(len(seen))
    )


def _viewing_angle(X_CT: SE3) -> float:
    """Return the angle between the line of sight and the normal of a tag [rad]."""
    return math.acos(min(abs(float(X_CT.R[:, 2] @ X_CT.p)) / float(np.linalg.norm(X_CT.p)), 1.0))


def _left_out(
    found: Contradiction,
    seen: Sightings,
    names: list[str],
    ids: list[int],
    sightings: Sequence[MappedSighting],
) -> LeftOut:
    members = found.group.members
    distances = np.array([sightings[i].distances for i in members])
    # Of a tag or a picture that is left out as a whole nothing tells where the rest has it. It was measured
    # by the coordinates that others checked before.
    known = bool(np.isfinite(distances).all())
    rms_px = math.sqrt(np.mean(distances**2)) if known else math.sqrt(2.0) * found.rms_px
    return LeftOut(
        kind=found.group.kind,
        tags=tuple(ids[tag] for tag in np.unique(seen.tag[members])),
        pictures=tuple(names[view] for view in np.unique(seen.view[members])),
        rms_px=rms_px,
        score=found.score,
    )


def _lens_sigma(adjusted: Adjusted) -> tuple[float, ...]:
    first, last = adjusted.bundle.lens_column, adjusted.bundle.variables
    variances = adjusted.sigma_px**2 * np.diag(adjusted.cofactors(np.arange(first, last)))
    return tuple(np.sqrt(variances).tolist())
