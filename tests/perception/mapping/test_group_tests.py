"""Tests of groups: by what leaving them out changes, and by the distributions that they approximate."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
from scipy.stats import chi2, norm
from scipy.stats import f as fisher

from msrr_perception.mapping.adjustment import Adjusted, adjust
from msrr_perception.mapping.bundle import Bundle, Sightings
from msrr_perception.mapping.group_tests import Group, GroupTests, Usual, quantile_outside
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera

VIEWS, TAGS, SIGMA_PX = 5, 5, 0.01
#: Sightings of tag 2 that are wrong: in pictures 1 and 3.
WRONG = [7, 17]


@cache
def adjusted(wrong_px: float) -> tuple[Adjusted, Sightings]:
    """Every tag in every picture, with noise so small that all is linear; two sightings of tag 2 are off."""
    rng = np.random.default_rng(7)

    def rotations(count: int, spread: float) -> Array:
        return np.stack([cv2.Rodrigues(w)[0] for w in rng.normal(0.0, spread, (count, 3))])

    p_CM = rng.uniform([-0.2, -0.2, 1.5], [0.2, 0.2, 2.0], (VIEWS, 3))
    p_MT, lens = rng.uniform(-0.4, 0.4, (TAGS, 3)), Lens(PinholeCamera(800, 600, 700.0))
    true = Bundle(lens, rotations(VIEWS, 0.3), p_CM, rotations(TAGS, 0.3), p_MT, 0, 0.1)
    view, tag = np.divmod(np.arange(VIEWS * TAGS), TAGS)
    seen = Sightings(view, tag, np.zeros((len(view), 4, 2)))
    seen = Sightings(
        view, tag, true.residuals(seen).reshape(-1, 4, 2) + rng.normal(0.0, SIGMA_PX, (25, 4, 2))
    )
    seen.corners[WRONG] += wrong_px
    return adjust(true, seen), seen


def test_what_a_group_adds_is_what_vanishes_when_it_is_left_out() -> None:
    found, seen = adjusted(0.0)
    tests = GroupTests(found, seen).all
    assert len(tests) == VIEWS * TAGS + VIEWS + TAGS
    for test in (*tests[:3], tests[VIEWS * TAGS], tests[VIEWS * TAGS + 2], tests[-1]):
        rest = np.ones(len(seen), dtype=np.bool_)
        rest[test.group.members] = False
        left = adjust(found.bundle.referred_to(int(test.group.kind == "tag")), seen.of(rest))
        vanished = found.residuals @ found.residuals - left.residuals @ left.residuals
        assert test.excess == pytest.approx(vanished, rel=1e-3)
        assert test.rank == found.redundancy - left.redundancy
        assert test.rms_px == pytest.approx(np.sqrt(vanished / test.rank), rel=1e-3)


def test_groups_are_all_sightings_of_a_tag_or_of_a_picture() -> None:
    found, seen = adjusted(0.0)
    for group in (test.group for test in GroupTests(found, seen).all[VIEWS * TAGS :]):
        of = seen.tag if group.kind == "tag" else seen.view
        np.testing.assert_array_equal(group.members, np.flatnonzero(of == of[group.members[0]]))


def test_a_quantile_is_that_of_the_f_distribution() -> None:
    found, seen = adjusted(0.0)
    for test in GroupTests(found, seen).all:
        others = found.redundancy - test.rank
        left = found.sigma_px**2 * found.redundancy - test.excess
        odds = fisher.sf(test.excess / test.rank / (left / others), test.rank, others)
        assert test.quantile == pytest.approx(norm.isf(odds), abs=0.02)


@pytest.mark.parametrize("rank", [1, 4, 8, 60])
def test_a_quantile_outside_of_a_map_is_that_of_chi_squared(rank: int) -> None:
    for odds in (0.5, 0.1, 1e-3):
        square = 0.3**2 * chi2.isf(odds, rank)
        assert quantile_outside(square, rank, 0.3) == pytest.approx(norm.isf(odds), abs=0.06)


def test_two_wrong_sightings_of_a_tag_are_those_behind_it() -> None:
    found, seen = adjusted(0.4)
    tests = GroupTests(found, seen)
    tag = Group("tag", np.flatnonzero(seen.tag == 2))
    asked: list[float] = []

    def is_likely(quantile: float) -> bool:
        asked.append(quantile)
        return quantile < 4.0

    few = tests.sightings_behind(tag, is_likely)
    assert sorted(int(one.group.members[0]) for one in few) == WRONG
    assert asked[0] > 4.0 > asked[1]
    # What is left of the tag is tested as if both had never been seen.
    rest = np.isin(np.arange(len(seen)), WRONG, invert=True)
    without, part = adjust(found.bundle, seen.of(rest)), seen.of(rest)
    (own,) = (
        t for t in GroupTests(without, part).all if t.group.kind == "tag" and 2 in part.tag[t.group.members]
    )
    assert asked[1] == pytest.approx(own.quantile, abs=0.02)
    assert tests.sightings_behind(tag, lambda _: False) == []


def test_groups_are_compared_with_those_of_their_kind() -> None:
    tests = GroupTests(*adjusted(0.4))
    for test in tests.all:
        alike = Usual.of([other.quantile for other in tests.all if other.group.kind == test.group.kind])
        assert test.score(tests.usual) == alike.score(test.quantile)


def test_usual_is_the_middle_and_the_spread_of_most_but_no_less_than_that_of_a_normal_distribution() -> None:
    normal = norm.ppf((np.arange(999) + 0.5) / 999)
    for middle, spread in ((0.0, 1.0), (1.5, 3.0)):
        usual = Usual.of([*(middle + spread * normal), *[1e3] * 5])
        assert usual == pytest.approx((middle, spread), abs=0.05)
        assert usual.score(middle + 2.0 * spread) == pytest.approx(2.0, abs=0.05)
    assert Usual.of((0.2 * normal - 3.0).tolist()) == Usual.of([]) == (0.0, 1.0)
