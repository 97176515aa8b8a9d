"""Sightings, tags and pictures that contradict the others: found by a statistical test and left out.

What is far off in the first place is left out before the first adjustment. Groups are tested as
:mod:`msrr_perception.mapping.group_tests` does. The group that is least likely is left out and the rest
adjusted again, until no group is too unlikely. Where less than half of the sightings of a tag or a picture
explain why it contradicts the others, only these are left out: several wrong sightings of one tag mask each
other, and the test of the tag does not tell which they are. A tag that has lost half of its sightings in this
way is left out as a whole: two sightings that agree with each other are no place for a tag if eight others
say that it is elsewhere, or of another size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.stats import chi2, norm
from scipy.stats import f as f_distribution

from msrr_perception.mapping.adjustment import Adjusted, AdjustmentError, adjust, adjust_robustly
from msrr_perception.mapping.bundle import Bundle, Sightings
from msrr_perception.mapping.group_tests import Group, GroupTest, GroupTests, Kind, Usual, quantile_outside
from msrr_perception.mapping.initial_map import OTHER_RAD, alternatives

#: Probability that anything of a map without contradictions is left out.
FALSE_ALARMS = 0.01

#: Number of coordinates of the corners of a sighting.
_NUMBERS = 8

#: Distance of a corner from where poses show it above which its sighting is left out before least squares
#: [px], or this multiple of the median of those distances, as with a lens that was not calibrated.
_FAR_PX, _FAR_MEDIANS = 20.0, 10.0

#: Kinds of groups that can bend a whole map.
_MANY: tuple[Kind, ...] = ("tag", "picture")

#: Relative gain of the residuals for which a pose is turned over; less is rounding.
_LEAST_GAIN = 1e-6

#: Probability with which the sum of squares at the true one of two poses is as much above that at the other
#: one, below which only that other one is taken to be possible.
_ALIKE = 0.0005


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
        may_be_turned: Largest angle [rad] by which each tag is turned, by its index, in maps with another of
            the two poses of a flat tag or of a view, that show what was detected nearly as well.
    """

    adjusted: Adjusted
    kept: NDArray[np.bool_]
    contradictions: tuple[Contradiction, ...]
    may_be_turned: Mapping[int, float]


def adjust_consistently(bundle: Bundle, seen: Sightings) -> Consistent:
    """Return the least-squares adjustment of all sightings but those that contradict the others.

    It begins with the poses of a robust adjustment. Sightings that the rest no longer connects with the most
    are not kept either.
    """
    kept = near(bundle, seen)
    contradictions = _far_off(bundle, seen, kept)
    for kind in _MANY:
        contradictions = _as_wholes(seen, kept, contradictions, kind)
    while True:
        kept = largest_connected(seen, kept)
        part = seen.of(kept)
        found = adjust(bundle.referred_to(most_seen_tag(part)), part)
        better, alike = _turned_over(found, part)
        if better is not None:
            bundle = better
            continue
        worst = _worst(found, part)
        if not worst:
            return Consistent(found, kept, tuple(contradictions), _angles(found.bundle, alike))
        of_all = np.flatnonzero(kept)
        for one in worst:
            members = of_all[one.group.members]
            kept[members] = False
            contradictions.append(replace(one, group=replace(one.group, members=members)))
        contradictions = _as_wholes(seen, kept, contradictions, "tag")


def near(bundle: Bundle, seen: Sightings) -> NDArray[np.bool_]:
    """Return which sightings are about where poses show them, shape (N,); all if those are not the most.

    What is far off, as a number that was read on something else, would bend a map for hundreds of steps, also
    by the robust cost, which is linear in large distances.
    """
    distances = np.linalg.norm(bundle.residuals(seen).reshape(-1, 4, 2), axis=2).max(axis=1)
    out: NDArray[np.bool_] = distances < max(_FAR_PX, _FAR_MEDIANS * float(np.median(distances)))
    return out if 2 * largest_connected(seen, out).sum() > len(seen) else np.ones_like(out)


def _far_off(bundle: Bundle, seen: Sightings, kept: NDArray[np.bool_]) -> list[Contradiction]:
    """Return each of the sightings that are not kept as a contradiction to the poses, the worst first."""
    squares = (bundle.residuals(seen).reshape(-1, _NUMBERS) ** 2).sum(axis=1)
    sigma_px = math.sqrt(float(np.median(squares[kept])) / chi2.median(_NUMBERS))
    found = [
        Contradiction(
            Group("sighting", np.array([i])),
            math.sqrt(squares[i] / _NUMBERS),
            quantile_outside(float(squares[i]), _NUMBERS, sigma_px),
        )
        for i in np.flatnonzero(~kept).tolist()
    ]
    return sorted(found, key=lambda one: -one.rms_px)


def _as_wholes(
    seen: Sightings, kept: NDArray[np.bool_], contradictions: list[Contradiction], kind: Kind
) -> list[Contradiction]:
    """Return contradictions with those of a tag or a picture as one, if it is half of its sightings or more.

    It has three or more. Its other sightings are left out of ``kept`` as well.
    """
    whole_of, apart = (seen.tag, "picture") if kind == "tag" else (seen.view, "tag")
    for whole in np.unique(whole_of).tolist():
        wrong = [c for c in contradictions if c.group.kind != apart and whole_of[c.group.members[0]] == whole]
        rest = np.flatnonzero(kept & (whole_of == whole))
        members = np.concatenate([rest, *(c.group.members for c in wrong)])
        if len(wrong) > 1 and len(members) > 2 and 2 * len(rest) <= len(members):
            kept[rest] = False
            rms_px = math.sqrt(np.mean([c.rms_px**2 for c in wrong]))
            as_one = Contradiction(Group(kind, np.sort(members)), rms_px, max(c.score for c in wrong))
            contradictions = [*(c for c in contradictions if c not in wrong), as_one]
    return contradictions


def _turned_over(found: Adjusted, seen: Sightings) -> tuple[Bundle | None, list[Bundle]]:
    """Return a better map in which one tag or one view has the other pose of a flat tag, if there is one.

    With it come those that are nearly as good, all of them where none is better.
    """
    alike: list[Bundle] = []
    limit = found.sigma_px**2 * float(f_distribution.isf(_ALIKE, 1, max(found.redundancy, 1)))
    for bundle in alternatives(found.bundle, seen, np.unique(seen.view), np.unique(seen.tag)):
        try:
            tried = adjust(adjust_robustly(bundle, seen).referred_to(found.bundle.reference), seen)
        except AdjustmentError:  # turned over, the map falls apart: the pose was right
            continue
        if tried.sigma_px < (1.0 - _LEAST_GAIN) * found.sigma_px:
            return tried.bundle, alike
        if tried.residuals @ tried.residuals - found.residuals @ found.residuals < limit:
            alike.append(tried.bundle)
    return None, alike


def _angles(bundle: Bundle, others: Sequence[Bundle]) -> dict[int, float]:
    """Return the largest angle [rad] by which other maps turn each tag, where they turn it over."""
    angles = dict[int, float]()
    for tag in range(bundle.tags):
        for other in others:
            cosine = 0.5 * (float((bundle.R_MT[tag] * other.R_MT[tag]).sum()) - 1.0)
            angle = math.acos(min(max(cosine, -1.0), 1.0))
            if angle > max(OTHER_RAD, angles.get(tag, 0.0)):
                angles[tag] = angle
    return angles


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
    tests = GroupTests(found, seen)
    limit = float(norm.isf(FALSE_ALARMS / len(tests.all)))
    worst, usual = max(tests.all, key=lambda test: test.score(tests.usual)), tests.usual
    if worst.score(usual) <= limit:
        spoiling = _spoiling(found, seen, tests, limit)
        if spoiling is None:
            return []
        worst, usual = spoiling
    spread = usual[worst.group.kind]
    few = tests.sightings_behind(worst.group, lambda quantile: spread.score(quantile) <= limit)
    return [Contradiction(one.group, one.rms_px, one.score(usual)) for one in few or [worst]]


def _spoiling(
    found: Adjusted, seen: Sightings, tests: GroupTests, limit: float
) -> tuple[GroupTest, Mapping[Kind, Usual]] | None:
    """Return a tag or a picture that stands out from what the others are without it, and how those spread.

    One that is wrong bends all others where these are few, so that they spread as widely as it stands out.
    """
    for kind in _MANY:
        of_kind = [test for test in tests.all if test.group.kind == kind]
        suspect = max(of_kind, key=lambda test: test.quantile, default=None)
        if suspect is None or suspect.quantile <= limit:
            continue
        rest = np.ones(len(seen), dtype=np.bool_)
        rest[suspect.group.members] = False
        part = seen.of(largest_connected(seen, rest))
        try:
            usual = GroupTests(adjust(found.bundle.referred_to(most_seen_tag(part)), part), part).usual
        except AdjustmentError:  # without it there is no map
            continue
        if suspect.score(usual) > limit:
            return suspect, usual
    return None
