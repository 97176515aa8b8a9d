"""Sightings, tags and pictures that contradict the others: found by a statistical test and left out.

A group of corners is tested against the map that all others make: if it is like the others, what vanishes
from the sum of squares together with it, by what is left, has an F distribution. The groups are single
sightings, all sightings of a tag (it moved) and all of a picture (it is blurred, or its tags moved). The
group that is least likely is left out and the rest adjusted again, until no group is too unlikely. Where
less than half of the sightings of a tag or a picture explain why it contradicts the others, only these are
left out: several wrong sightings of one tag mask each other, and the test of the tag does not tell which they
are. A tag that has lost half of its sightings in this way is left out as a whole: two sightings that agree
with each other are no place for a tag if eight others say that it is elsewhere, or of another size. Source:
W. Baarda, "A testing procedure for use in geodetic networks", 1968 (data snooping), for groups.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.stats import norm

from msrr_perception.mapping.adjustment import Adjusted, AdjustmentError, adjust, adjust_robustly
from msrr_perception.mapping.bundle import Bundle, Sightings
from msrr_perception.mapping.initial_map import alternatives
from msrr_scenes.arrays import Array

#: Probability that anything of a map without contradictions is left out.
FALSE_ALARMS = 0.01

#: Share of a corner that has to be checked by others for it to count in the test.
_LEAST_REDUNDANCY = 1e-6

#: Relative gain of the residuals for which a pose is turned over; less is rounding.
_LEAST_GAIN = 1e-6

Kind = Literal["sighting", "tag", "picture"]


@dataclass(frozen=True, eq=False)
class Group:
    """Corners that are tested together.

    Attributes:
        kind: What they are.
        members: Indices of the sightings, shape (k,).
    """

    kind: Kind
    members: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Contradiction:
    """A group that was left out.

    Attributes:
        group: The group; its members are indices of all sightings.
        rms_px: Root mean square of the coordinates of its corners that others check, against these [px]; of a
            tag that was found sighting by sighting, of these.
        score: How unlikely it is, as the quantile of a standard normal distribution; of such a tag, that of
            its least likely sighting.
    """

    group: Group
    rms_px: float
    score: float


@dataclass(frozen=True, eq=False)
class Consistent:
    """The adjustment of what does not contradict itself.

    Attributes:
        adjusted: The adjustment.
        kept: Which sightings it is of, shape (N,).
        contradictions: What was left out, the worst first.
    """

    adjusted: Adjusted
    kept: NDArray[np.bool_]
    contradictions: tuple[Contradiction, ...]


def adjust_consistently(bundle: Bundle, seen: Sightings) -> Consistent:
    """Return the least-squares adjustment of all sightings but those that contradict the others.

    Sightings that the rest no longer connects with the most are not kept either.

    Args:
        bundle: Poses of a robust adjustment.
        seen: The sightings.
    """
    kept = np.ones(len(seen), dtype=np.bool_)
    contradictions: list[Contradiction] = []
    while True:
        kept = largest_connected(seen, kept)
        part = seen.of(kept)
        found = adjust(bundle.referred_to(most_seen_tag(part)), part)
        turned = _turned_over(found, part)
        if turned is not None:
            bundle = turned
            continue
        worst = _worst(found, part)
        if not worst:
            return Consistent(found, kept, tuple(contradictions))
        of_all = np.flatnonzero(kept)
        for one in worst:
            members = of_all[one.group.members]
            kept[members] = False
            contradictions.append(replace(one, group=replace(one.group, members=members)))
        contradictions = _by_tag(seen, kept, contradictions)


def _by_tag(
    seen: Sightings, kept: NDArray[np.bool_], contradictions: list[Contradiction]
) -> list[Contradiction]:
    """Return contradictions with those of a tag as one, if it is half of its sightings, of three or more.

    Its other sightings are left out of ``kept`` as well.
    """
    of_tag = {
        tag: [c for c in contradictions if c.group.kind != "picture" and seen.tag[c.group.members[0]] == tag]
        for tag in np.unique(seen.tag).tolist()
    }
    for tag, wrong in of_tag.items():
        rest = np.flatnonzero(kept & (seen.tag == tag))
        members = np.concatenate([rest, *(c.group.members for c in wrong)])
        if len(wrong) > 1 and len(members) > 2 and 2 * len(rest) <= len(members):
            kept[rest] = False
            rms_px = math.sqrt(np.mean([c.rms_px**2 for c in wrong]))
            whole = Contradiction(Group("tag", np.sort(members)), rms_px, max(c.score for c in wrong))
            contradictions = [*(c for c in contradictions if c not in wrong), whole]
    return contradictions


def _turned_over(found: Adjusted, seen: Sightings) -> Bundle | None:
    """Return a better map in which one tag or one view has the other pose of a flat tag, if there is one."""
    for bundle in alternatives(found.bundle, seen, np.unique(seen.view), np.unique(seen.tag)):
        try:
            tried = adjust(adjust_robustly(bundle, seen).referred_to(found.bundle.reference), seen)
        except AdjustmentError:  # turned over, the map falls apart: the pose was right
            continue
        if tried.sigma_px < (1.0 - _LEAST_GAIN) * found.sigma_px:
            return tried.bundle
    return None


def most_seen_tag(seen: Sightings) -> int:
    """Return the index of the tag with the most sightings, of equals the first."""
    return int(np.bincount(seen.tag).argmax())


def largest_connected(seen: Sightings, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which of the kept sightings hang together with the most others by tags and pictures, (N,)."""
    views, tags = seen.view.max() + 1, seen.tag.max() + 1
    edges = (np.ones(int(kept.sum())), (seen.view[kept], views + seen.tag[kept]))
    _, label = connected_components(coo_array(edges, shape=(views + tags, views + tags)), directed=False)
    part = label[seen.view]
    out: NDArray[np.bool_] = kept & (part == np.bincount(part[kept]).argmax())
    return out


def _worst(found: Adjusted, seen: Sightings) -> list[Contradiction]:
    """Return the group that contradicts the others most, or the few sightings for which it does."""
    Q = found.factor.solve(np.eye(found.bundle.variables))
    tested = [(group, *_tested(found, Q, group)) for group in _groups(seen)]
    tested = [(group, excess, rank) for group, excess, rank in tested if rank]
    if not tested or not found.redundancy:
        raise AdjustmentError("no corner is checked by others; take more pictures of every tag")
    usual = {
        kind: _Usual.of(
            [_quantile(found, excess, rank) for group, excess, rank in tested if group.kind == kind]
        )
        for kind in get_args(Kind)
    }
    scores = [usual[group.kind].score(_quantile(found, excess, rank)) for group, excess, rank in tested]
    limit, k = norm.isf(FALSE_ALARMS / len(tested)), int(np.argmax(scores))
    if scores[k] <= limit:
        return []
    group, excess, rank = tested[k]
    few = _sightings_behind(found, Q, group, lambda quantile: usual[group.kind].score(quantile) <= limit)
    if not few:
        return [Contradiction(group, math.sqrt(excess / rank), scores[k])]
    return [
        Contradiction(one, math.sqrt(excess / rank), usual[one.kind].score(_quantile(found, excess, rank)))
        for one, excess, rank in few
    ]


def _sightings_behind(
    found: Adjusted, Q: Array, group: Group, is_likely: Callable[[float], bool]
) -> list[tuple[Group, float, int]]:
    """Return the sightings, less than half of a group, without which the others of it agree with the rest.

    They are found one after the other, each as that which takes most from the sum of squares together with
    those before.

    Returns:
        Each sighting, what it takes [px^2], and how many of its numbers are checked; empty if a rest of more
        than half of the group does not agree.
    """
    whole, of_whole = _tested(found, Q, group)
    r, C = _unexplained(found, Q, group)
    few: list[tuple[Group, float, int]] = []
    taken, of_taken, left = 0.0, 0, list(range(len(group.members)))
    while 2 * (len(few) + 1) < len(group.members):
        redundancy, directions = np.linalg.eigh(np.array([C[_own(k), _own(k)] for k in left]))
        checked = redundancy > _LEAST_REDUNDANCY
        along = np.einsum("kij,ki->kj", directions, np.array([r[_own(k)] for k in left]))
        weight = np.where(checked, 1.0, 0.0) / np.where(checked, redundancy, 1.0)
        excess = (along**2 * weight).sum(axis=1)
        n = int(np.argmax(excess))
        rank, k = int(checked[n].sum()), left.pop(n)
        if not rank:  # nothing else checks what is left
            return []
        few.append((Group("sighting", group.members[k : k + 1]), float(excess[n]), rank))
        taken, of_taken = taken + float(excess[n]), of_taken + rank
        if of_whole <= of_taken or is_likely(
            _quantile(found, whole - taken, of_whole - of_taken, taken, of_taken)
        ):
            return few
        # Without that sighting, the others of the group are checked by the rest alone.
        gain = C[:, _own(k)] @ (directions[n] * weight[n]) @ directions[n].T
        r, C = r - gain @ r[_own(k)], C - gain @ C[_own(k)]
    return []


def _own(sighting: int) -> slice:
    """Return the rows of one sighting of a group."""
    return slice(8 * sighting, 8 * sighting + 8)


def _groups(seen: Sightings) -> list[Group]:
    groups = [Group("sighting", np.array([i])) for i in range(len(seen))]
    tags = [Group("tag", np.flatnonzero(seen.tag == tag)) for tag in np.unique(seen.tag)]
    pictures = [Group("picture", np.flatnonzero(seen.view == view)) for view in np.unique(seen.view)]
    return groups + [group for group in tags + pictures if len(group.members) > 1]


def _unexplained(found: Adjusted, Q: Array, group: Group) -> tuple[Array, Array]:
    """Return the residuals of a group [px], and what share of its numbers' errors they are, as a matrix."""
    rows = (8 * group.members[:, np.newaxis] + np.arange(8)).ravel()
    r, J = found.residuals[rows], found.jacobian[rows].toarray()
    return r, np.eye(len(rows)) - J @ Q @ J.T


def _tested(found: Adjusted, Q: Array, group: Group) -> tuple[float, int]:
    """Return what a group adds to the sum of squares [px^2], and how many of its numbers are checked."""
    r, C = _unexplained(found, Q, group)
    redundancy, directions = np.linalg.eigh(C)
    checked = redundancy > _LEAST_REDUNDANCY
    along = directions[:, checked].T @ r
    return float((along**2 / redundancy[checked]).sum()), int(checked.sum())


def _quantile(found: Adjusted, excess: float, rank: int, without: float = 0.0, of_without: int = 0) -> float:
    """Return the quantile of a standard normal distribution that is as unlikely as what a group adds.

    What it adds is compared with what is left without it, so that a group which spoils the whole map is told
    from those that it spoils. Source: E. Paulson, "An approximate normalization of the analysis of variance
    distribution", Annals of Mathematical Statistics 13, 1942; the tail of F itself underflows.

    Args:
        found: The adjustment of all.
        excess: What the group adds to the sum of squares [px^2].
        rank: Number of its numbers that are checked.
        without: What others add that are left out as well [px^2].
        of_without: Number of theirs that are checked.
    """
    others = found.redundancy - rank - of_without
    left = found.sigma_px**2 * found.redundancy - excess - without
    if others <= 0 or left <= 0.0:  # nothing is left that could be compared
        return 0.0
    root = math.cbrt(excess / rank / (left / others))
    own, rest = 2.0 / (9.0 * rank), 2.0 / (9.0 * others)
    return ((1.0 - rest) * root - (1.0 - own)) / math.sqrt(rest * root**2 + own)


class _Usual(NamedTuple):
    """How the quantiles of groups of one kind spread.

    Blur differs from picture to picture and paper from tag to tag, and what several corners of one tag have
    in common does not average out. So the groups may spread more widely than F; less widely does not count.
    """

    middle: float
    spread: float

    @classmethod
    def of(cls, quantiles: Sequence[float]) -> _Usual:
        if not quantiles:
            return cls(0.0, 1.0)
        middle = float(np.median(quantiles))
        spread = float(np.median(abs(np.array(quantiles) - middle))) / float(norm.ppf(0.75))
        return cls(max(middle, 0.0), max(spread, 1.0))

    def score(self, quantile: float) -> float:
        """Return by how many deviations a group stands out from the others."""
        return (quantile - self.middle) / self.spread
