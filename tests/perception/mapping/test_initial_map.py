"""First guesses of a map, and which sightings they are of."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from msrr_perception.mapping.bundle import Bundle, Sightings
from msrr_perception.mapping.consistency import largest_connected, most_seen_tag, near
from msrr_perception.mapping.initial_map import alternatives, initial_bundle
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera

LENS = Lens(PinholeCamera(800, 600, 700.0), Distortion(k1=-0.05, aspect=1.01))
VIEWS, TAGS = 4, 5


def exact(tag_size: float) -> tuple[Bundle, Sightings]:
    """A map, and every tag of it in every picture, exactly where it is."""
    rng = np.random.default_rng(3)

    def rotations(count: int, spread: float) -> Array:
        return np.stack([cv2.Rodrigues(w)[0] for w in rng.normal(0.0, spread, (count, 3))])

    p_CM, p_MT = (
        rng.uniform([-0.2, -0.2, 1.5], [0.2, 0.2, 2.0], (VIEWS, 3)),
        rng.uniform(-0.4, 0.4, (TAGS, 3)),
    )
    true = Bundle(LENS, rotations(VIEWS, 0.2), p_CM, rotations(TAGS, 0.3), p_MT, 0, tag_size).referred_to(0)
    view, tag = np.divmod(np.arange(VIEWS * TAGS), TAGS)
    corners = true.residuals(Sightings(view, tag, np.zeros((len(view), 4, 2)))).reshape(-1, 4, 2)
    return true, Sightings(view, tag, corners)


@pytest.mark.parametrize("shown", [1.0, 0.6])
def test_exact_corners_give_nearly_exact_poses(shown: float) -> None:
    """Also where the pictures hang together by some of their tags only."""
    true, seen = exact(0.15)
    seen = seen.of((seen.view + 2 * seen.tag) % 5 < 5 * shown)
    guess = initial_bundle(seen, LENS, 0.15)
    assert np.abs(guess.residuals(seen)).max() < 0.01
    np.testing.assert_allclose(guess.X_MT(guess.reference).matrix(), np.eye(4), atol=1e-12)
    for tag in range(TAGS):
        expected = true.referred_to(guess.reference).X_MT(tag).matrix()
        np.testing.assert_allclose(guess.X_MT(tag).matrix(), expected, atol=1e-4)


@pytest.mark.parametrize("tag", [1, 3])
def test_a_tag_that_is_seen_at_a_slant_comes_first(tag: int) -> None:
    """All others face the cameras: both of their poses are right, or wrong where a print is narrow."""
    true, seen = exact(0.15)
    flat = replace(true, R_CM=np.tile(np.eye(3), (VIEWS, 1, 1)), R_MT=np.tile(np.eye(3), (TAGS, 1, 1)))
    flat.R_MT[tag] = cv2.Rodrigues(np.array([0.5, 0.3, 0.0]))[0]
    corners = flat.residuals(replace(seen, corners=np.zeros_like(seen.corners))).reshape(-1, 4, 2)
    corners[0] = corners[0].mean(axis=0) + (corners[0] - corners[0].mean(axis=0)) * [1.0, 0.5]
    assert initial_bundle(replace(seen, corners=corners), LENS, 0.15).reference == tag


def test_an_alternative_turns_one_pose_over_and_shows_it_where_it_was_seen() -> None:
    """Small tags, of which two poses are hardly told apart; picture 3 shows one of them alone."""
    true, seen = exact(0.04)
    seen = seen.of((seen.view < 3) | (seen.tag == 4))
    found = list(alternatives(true, seen, np.arange(VIEWS), np.arange(TAGS)))
    whole = []
    for other in found:
        same = true.referred_to(other.reference)
        angles = [
            math.degrees(np.linalg.norm(cv2.Rodrigues(a.R @ b.R.T)[0]))
            for a, b in (
                *((other.X_MT(tag), same.X_MT(tag)) for tag in range(TAGS)),
                *((other.X_CM(view), same.X_CM(view)) for view in range(VIEWS)),
            )
        ]
        (turned,) = np.flatnonzero(np.array(angles) > 1e-4)
        assert angles[turned] > 8.0
        of = seen.tag == turned if turned < TAGS else seen.view == turned - TAGS
        off = np.linalg.norm(other.residuals(seen).reshape(-1, 4, 2), axis=2).mean(axis=1)
        assert off[~of].max() < 1e-6
        assert 0.0 < off[of].mean() < 8.0
        whole.append(int(turned))
    assert whole[-1] == TAGS + 3
    assert len(whole) > 2
    np.testing.assert_array_equal(true.residuals(seen), exact(0.04)[0].residuals(seen))  # it stays as it was


def test_sightings_hang_together_by_tags_and_pictures() -> None:
    """Pictures 0 and 1 share tag 1, and picture 2 shares none with them."""
    view, tag = np.array([0, 0, 1, 2, 2]), np.array([0, 1, 1, 2, 3])
    seen = Sightings(view, tag, np.zeros((5, 4, 2)))
    for kept, expected in (
        ([1, 1, 1, 1, 1], [1, 1, 1, 0, 0]),
        ([1, 0, 0, 1, 1], [0, 0, 0, 1, 1]),
        ([0, 1, 1, 1, 0], [0, 1, 1, 0, 0]),
    ):
        assert largest_connected(seen, np.array(kept, dtype=np.bool_)).tolist() == [bool(e) for e in expected]
    assert most_seen_tag(seen) == 1


def test_what_is_far_off_is_left_out_unless_most_are_or_the_map_would_fall_apart() -> None:
    true, seen = exact(0.15)
    seen.corners[[3, 8], 2] += [21.0, 0.0]  # one corner of each of two
    seen.corners[4] += [19.0, 0.0]
    assert np.flatnonzero(~near(true, seen)).tolist() == [3, 8]
    seen.corners[:11] += [100.0, 0.0]
    assert near(true, seen).all()
    true, seen = exact(0.15)
    halves = seen.of(np.where(seen.view < 2, seen.tag <= 2, seen.tag >= 2))  # which share tag 2
    halves.corners[(halves.tag == 2) & (halves.view == 2)] += 100.0
    assert near(true, halves).sum() == len(halves) - 1
    halves.corners[(halves.tag == 2) & (halves.view == 3)] += 100.0
    assert near(true, halves).all()
