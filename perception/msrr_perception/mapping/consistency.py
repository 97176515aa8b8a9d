"""Sightings, tags and pictures that contradict the others: found by a statistical test and left out.

Groups are tested as :mod:`msrr_perception.mapping.group_tests` does. The group that is least likely is left
out and the rest adjusted again, until no group is too unlikely. Where less than half of the sightings of a
tag or a picture explain why it contradicts the others, only these are left out: several wrong sightings of
one tag mask each other, and the test of the tag does not tell which they are. A tag that has lost half of its
sightings in this way is left out as a whole: two sightings that agree with each other are no place for a tag
if eight others say that it is elsewhere, or of another size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.stats import norm

from msrr_perception.mapping.adjustment import Adjusted, AdjustmentError, adjust, adjust_robustly
from msrr_perception.mapping.bundle import Bundle, Sightings
from msrr_perception.mapping.group_tests import Group, GroupTest, GroupTests, Kind, Usual
from msrr_perception.mapping.initial_map import alternatives

#: Probability that anything of a map without contradictions is left out.
FALSE_ALARMS = 0.01

#: Kinds of groups that can bend a whole map.
_MANY: tuple[Kind, ...] = ("tag", "picture")

#: Relative gain of the residuals for which a pose is turned over; less is rounding.
_LEAST_GAIN = 1e-6


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
