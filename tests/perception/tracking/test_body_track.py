"""The track of a body: standing, driving, starting, stopping, turning, moved by hand, unseen, seen late.

Bodies are exact arcs; measurements have an error that is drawn per frame and one that stays while the body
stands.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_perception.pose.overhead_errors import PoseErrors
from msrr_perception.tracking.body_track import BodyTrack, Motion, TrackNoise
from msrr_perception.tracking.seen_pose import SeenPose
from msrr_scenes.arrays import frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, Twist
from msrr_scenes.specs.vehicle import LimitsSpec
from tests.conftest import pose_error

LIMITS = LimitsSpec.model_validate({})
NOISE = TrackNoise(LIMITS)
STEP_S, FRAME_STEPS = 0.01, 10
NS = 1_000_000_000
#: Standard deviations of (x, y, yaw): per frame, and while the body stands.
FRAME, LASTING = np.array([1e-5, 1e-5, 3e-4]), np.array([1.2e-5, 1.2e-5, 3e-4])
R = np.diag(FRAME**2 + LASTING**2)
#: The same variances, with errors of place and yaw that are correlated.
CORRELATED = np.sqrt(R) @ np.array([[1.0, 0.3, -0.2], [0.3, 1.0, 0.5], [-0.2, 0.5, 1.0]]) @ np.sqrt(R)
#: A body that does not move unless it drives.
STILL = replace(NOISE, drift=0.0, turn_drift=0.0, unseen_drift=0.0, unseen_turn_drift=0.0)


def seen(stamp_ns: int, X_WB: SE2, error: np.ndarray | None = None, covariance: np.ndarray = R) -> SeenPose:
    x, y, yaw = X_WB.as_array() + (np.zeros(3) if error is None else error)
    # As in every message: for an array that can be written, kernels would be compiled once more.
    pose = GlobalPose("c", stamp_ns, SE2(x, y, yaw), frozen(covariance))
    return SeenPose(pose, np.diag(LASTING**2))


@dataclass
class Scene:
    """A body that follows its twist, slips by ``slip`` [m per square root of a metre] and is measured."""

    seed: int = 0
    X_WB: SE2 = field(default_factory=lambda: SE2(0.3, -0.4, 3.0))
    twist: Callable[[float], Twist] = lambda t: Twist()
    slip: float = 0.0
    track: BodyTrack | None = None
    step: int = 0

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self._place: SE2 | None = None

    @property
    def now_ns(self) -> int:
        return round(self.step * STEP_S * NS)

    def measured(self) -> SeenPose:
        if self._place != self.X_WB:
            self._place, self._lasting = self.X_WB, LASTING * self.rng.normal(size=3)
        return seen(self.now_ns, self.X_WB, self._lasting + FRAME * self.rng.normal(size=3))

    def run(self, until_s: float, blind: bool = False, watch: Callable[[], None] = lambda: None) -> BodyTrack:
        """Drive, and measure every frame unless the camera is blind; watch after every step."""
        while self.step < round(until_s / STEP_S):
            if self.step % FRAME_STEPS == 0 and not blind:
                now = self.measured()
                self.track = self.track.after(now, NOISE) if self.track else BodyTrack.at_rest(now)
            watch()
            u = self.twist(self.step * STEP_S)
            aside = self.slip * math.sqrt(abs(u.v) * STEP_S) * self.rng.normal()
            self.X_WB = self.X_WB @ SE2.exp(u.v * STEP_S, aside, u.w * STEP_S)
            self.step += 1
        assert self.track is not None
        return self.track

    def error(self) -> np.ndarray:
        assert self.track is not None
        return pose_error(self.track.pose(self.now_ns, NOISE).X_WB, self.X_WB)

    def nees(self) -> float:
        assert self.track is not None
        e, P = self.error(), self.track.pose(self.now_ns, NOISE).covariance
        np.testing.assert_allclose(P, P.T, rtol=1e-9, atol=1e-18)
        return float(e @ np.linalg.solve(P, e))


def drives_after(start_s: float, v: float, w: float) -> Callable[[float], Twist]:
    """A drive that reaches its twist as fast as the limits allow."""

    def twist(t: float) -> Twist:
        dt = max(t - start_s, 0.0)
        reached_v, reached_w = LIMITS.a_max_mps2 * dt, LIMITS.dw_max_radps2 * dt
        return Twist(math.copysign(min(abs(v), reached_v), v), math.copysign(min(abs(w), reached_w), w))

    return twist


def test_a_parked_body_is_known_as_well_as_its_lasting_error_allows() -> None:
    """60 bodies seen for 3 s: the summed NEES is chi-square with 180 degrees of freedom, odds 1e-4."""
    scenes = [Scene(seed) for seed in range(60)]
    for scene in scenes:
        track = scene.run(3.0)
        assert track.motion is Motion.STANDS
        sigma = np.sqrt(np.diag(track.pose(scene.now_ns, NOISE).covariance))
        assert (sigma > LASTING).all()
        assert (sigma < 1.4 * LASTING).all()
    low, high = chi2.ppf([5e-5, 1 - 5e-5], 180)
    assert low < sum(scene.nees() for scene in scenes) < high


def test_a_body_that_drives_as_assumed_is_known_as_well_as_stated() -> None:
    """100 bodies that accelerate and slip at random as strongly as assumed, 0.01 .. 0.16 s after a frame.

    The drives are independent: the summed NEES is chi-square with 300 degrees of freedom, odds 1e-4.
    """
    total, n = 0.0, 100
    growth = math.sqrt(NOISE.lasts_s * STEP_S) * NOISE.usual
    for seed in range(n):
        rng = np.random.default_rng(1000 + seed)
        v, w = (
            np.cumsum(rng.normal(0.0, growth * limit, 400))
            for limit in (LIMITS.a_max_mps2, LIMITS.dw_max_radps2)
        )
        scene = Scene(
            seed,
            twist=lambda t, v=v, w=w: Twist(0.2 + v[round(t / STEP_S)], w[round(t / STEP_S)]),
            slip=NOISE.sideways,
        )
        scene.run(1.91)
        scene.run(1.9 + STEP_S * rng.integers(1, 17), blind=True)
        total += scene.nees()
    low, high = chi2.ppf([5e-5, 1 - 5e-5], 3 * n)
    assert low < total < high


@pytest.mark.parametrize(
    ("v", "w"), [(0.4, 0.0), (-0.2, 0.0), (0.25, 1.0), (0.0, 1.5), (0.0, -0.3), (0.02, 0.0)]
)
def test_a_start_is_followed_from_the_first_frame_that_shows_it(v: float, w: float) -> None:
    """As hard as the limits allow, straight, on an arc or on the spot: no measurement is rejected."""
    scene = Scene(twist=drives_after(1.03, v, w))
    assert scene.run(1.05).motion is Motion.STANDS
    while scene.now_ns < 2.6 * NS:
        track = scene.run(1e-9 * scene.now_ns + STEP_S)
        assert track.rejected == 0
        if scene.now_ns >= 1.21 * NS:
            assert track.motion is Motion.DRIVES
        if scene.now_ns >= 2.3 * NS:  # constant twist
            assert np.abs(scene.error()[:2]).max() < 5e-4
            assert abs(scene.error()[2]) < 0.01
    np.testing.assert_allclose(track.state[3:], [v, w], atol=0.02)


@pytest.mark.parametrize("turned_deg", [0.3, 1.2])
def test_a_tag_that_is_turned_on_its_roof_makes_no_drive_seem_impossible(turned_deg: float) -> None:
    """100 bodies with tags turned as far as their tolerance says: no measurement of their drives is rejected.

    Such a tag does not point where its body drives: from frame to frame that goes 0.5 mm to the side of its
    heading at 1.2 degrees. Errors are against where the tag points. The bodies are independent: if the summed
    NEES were chi-square with 300 degrees of freedom, it would be above its bound once in 10,000 times.
    """
    turned, nees, n = math.radians(turned_deg), 0.0, 100
    own = np.diag([0.0, 0.0, turned**2])
    errors = PoseErrors(own, np.zeros((3, 3)), own)
    for seed in range(n):
        rng = np.random.default_rng(seed)
        yaw, twist = turned * rng.normal(), Twist(0.25, rng.uniform(-0.3, 0.3))
        X_WB, track = SE2(0.3, -0.4, rng.uniform(-math.pi, math.pi)), None
        for frame in range(20):
            noise = np.sqrt(np.diag(R)) * rng.normal(size=3)
            now = replace(seen(frame * NS // 10, X_WB, noise + np.array([0.0, 0.0, yaw])), errors=errors)
            track = track.after(now, NOISE) if track else BodyTrack.at_any_speed(now, LIMITS)
            assert track.rejected == 0
            X_WB = X_WB @ SE2.exp(0.1 * twist.v, 0.0, 0.1 * twist.w)
        assert track is not None
        pose = track.pose(2 * NS, NOISE)
        e = pose_error(pose.X_WB, X_WB) - np.array([0.0, 0.0, yaw])
        nees += float(e @ np.linalg.solve(pose.covariance - own, e))
    assert nees < chi2.ppf(1 - 1e-4, 3 * n)


def test_a_tag_that_is_held_beside_its_place_goes_round_as_its_body_turns_on_the_spot() -> None:
    """100 bodies with tags up to 0.3 mm (1 sigma) beside their places turn by 0.1 rad from frame to frame.

    Errors are against where the tag says the body is. The bodies are independent: if the summed NEES were
    chi-square with 300 degrees of freedom, it would be above its bound once in 10,000 times.
    """
    beside, nees, n = 3e-4, 0.0, 100
    own = np.diag([beside**2, beside**2, 0.0])
    errors = PoseErrors(own, np.zeros((3, 3)), own)
    for seed in range(n):
        rng = np.random.default_rng(seed)
        X_BX = SE2(*(beside * rng.normal(size=2)).tolist(), 0.0)
        X_WB, track = SE2(0.3, -0.4, rng.uniform(-math.pi, math.pi)), None
        for frame in range(20):
            noise = np.sqrt(np.diag(R)) * rng.normal(size=3)
            now = replace(seen(frame * NS // 10, X_WB @ X_BX, noise), errors=errors)
            track = track.after(now, NOISE) if track else BodyTrack.at_any_speed(now, LIMITS)
            assert track.rejected == 0
            X_WB = X_WB @ SE2(0.0, 0.0, 0.1)
        assert track is not None
        pose = track.pose(2 * NS, NOISE)
        e = pose_error(pose.X_WB, X_WB @ X_BX)
        nees += float(e @ np.linalg.solve(pose.covariance - own, e))
    assert nees < chi2.ppf(1 - 1e-4, 3 * n)


@pytest.mark.parametrize(("v", "w"), [(0.3, 0.4), (0.0, 1.2)])
def test_a_stop_is_noticed_and_the_body_is_known_to_hundredths_of_a_millimetre_again(
    v: float, w: float
) -> None:
    """It brakes from 2 s on, as hard as the limits allow."""
    stops_s = 2.0 + max(v / LIMITS.a_max_mps2, w / LIMITS.dw_max_radps2)

    def braking(t: float) -> Twist:
        dt = max(t - 2.0, 0.0)
        return Twist(max(v - LIMITS.a_max_mps2 * dt, 0.0), max(w - LIMITS.dw_max_radps2 * dt, 0.0))

    scene = Scene(twist=braking)
    assert scene.run(stops_s).motion is Motion.DRIVES
    track = scene.run(stops_s + 0.5)
    assert track.motion is Motion.STANDS
    track = scene.run(4.0)
    assert track.rejected == 0
    later = track.pose(scene.now_ns + NS // 2, NOISE)
    assert np.abs(pose_error(later.X_WB, scene.X_WB)[:2]).max() < 6e-5
    assert math.sqrt(later.covariance[0, 0]) < 3e-5


def test_slow_creeping_is_no_standing() -> None:
    """At 2 mm/s a body that were taken to stand would soon be off by many standard deviations."""
    scene = Scene(twist=lambda t: Twist(0.002))
    scene.run(2.0)
    squares: list[float] = []
    scene.run(8.0, watch=lambda: squares.append(scene.nees()))
    assert np.mean(squares) < 6.0


def test_creeping_is_no_standing_where_measurements_are_coarse() -> None:
    """At 6 cm/s and 5 mm, three measurements in a row lie at one place as often as not."""
    rng, P = np.random.default_rng(6), np.diag([0.005, 0.005, math.radians(1.0)]) ** 2
    track, errors = None, []
    for i in range(200):
        X_WB = SE2(0.006 * i, 0.0, 0.0)
        noisy = X_WB @ SE2(*rng.normal(size=3) * np.sqrt(np.diag(P)))
        coarse = SeenPose(GlobalPose("c", i * NS // 10, noisy, P), np.zeros((3, 3)))
        track = track.after(coarse, NOISE) if track else BodyTrack.at_rest(coarse)
        errors.append(pose_error(track.pose(i * NS // 10, NOISE).X_WB, X_WB))
        if i > 10:
            assert track.motion is Motion.DRIVES
    assert np.sqrt(np.mean(np.square(errors[10:]), axis=0))[:2].max() < 0.005


@pytest.mark.parametrize("drives", [False, True])
def test_what_no_motion_explains_is_rejected_twice_and_believed_the_third_time(drives: bool) -> None:
    """The body is moved 5 cm to its side."""
    scene = Scene(twist=lambda t: Twist(0.2 if drives else 0.0))
    track = scene.run(2.05)
    before = track.state
    scene.X_WB = scene.X_WB @ SE2(0.0, 0.05, 0.0)
    for rejected in (1, 2):
        track = scene.run(2.05 + 0.1 * rejected)
        assert track.rejected == rejected
        np.testing.assert_array_equal(track.state, before)
    assert scene.run(2.35).rejected == 0
    scene.run(2.85)
    assert np.abs(scene.error()[:2]).max() < 5e-4
    assert scene.track is not None
    assert scene.track.motion is (Motion.DRIVES if drives else Motion.STANDS)


@pytest.mark.parametrize("drives", [False, True])
def test_one_wrong_measurement_changes_nothing(drives: bool) -> None:
    scene = Scene(twist=lambda t: Twist(0.2 if drives else 0.0))
    track = scene.run(2.05)
    wrong = track.after(seen(2_100_000_000, SE2(-1.0, 0.7, 0.0)), NOISE)
    assert (wrong.rejected, wrong.seen) == (1, track.seen)
    assert wrong.pose(3 * NS, NOISE).X_WB == track.pose(3 * NS, NOISE).X_WB
    right = wrong.after(seen(2_200_000_000, SE2(*track.pose(2_200_000_000, NOISE).X_WB.as_array())), NOISE)
    assert right.rejected == 0


def test_a_gap_is_bridged_with_the_last_twist_but_not_for_ever() -> None:
    """On an arc: after 0.5 s the body is where its twist leads, within a covariance that has grown.

    Unseen for 4 s it may have stopped or driven on: the error of either is within two standard deviations.
    """
    scene = Scene(twist=lambda t: Twist(0.25, 0.3))
    track = scene.run(2.05)
    for gap_s in (0.2, 0.5):
        scene.run(2.0 + gap_s, blind=True)
        sigma = np.sqrt(np.diag(track.pose(scene.now_ns, NOISE).covariance))
        assert np.abs(scene.error()[:2]).max() < 0.01
        assert scene.nees() < 3.0
    assert sigma[:2].max() > 0.003
    track, stopped = scene.run(3.05), scene.X_WB
    assert track.rejected == 0
    scene.run(7.0, blind=True)
    lost = track.pose(scene.now_ns, NOISE)
    a_second_on = track.pose(3_000_000_000 + NS, NOISE)
    assert pose_error(lost.X_WB, a_second_on.X_WB) == pytest.approx(0.0, abs=1e-9), "it waits there"
    reach = 2.0 * math.sqrt(float(np.linalg.eigvalsh(lost.covariance[:2, :2]).max()))
    for X in (stopped, scene.X_WB):
        assert math.hypot(X.x - lost.X_WB.x, X.y - lost.X_WB.y) < reach


def test_errors_of_calibration_and_of_the_clock_are_part_of_the_covariance() -> None:
    """Those of calibration always; that of the clock only for a body that moves, by the way in that time."""
    own, shared = np.diag([1e-6, 2e-6, 3e-6]), np.diag([4e-6, 5e-6, 6e-6])
    timed = replace(NOISE, clock_s=0.01)
    for twist, clock_s in ((Twist(), 0.0), (Twist(0.25, 0.3), 0.01)):
        track = Scene(twist=lambda t, u=twist: u).run(2.05)
        plain = track.pose(2_100_000_000, NOISE)
        assert plain.shared is None
        errors = PoseErrors(own, shared, held=0.5 * own)
        doubted = replace(track, seen=replace(track.seen, errors=errors))
        found = doubted.pose(2_100_000_000, timed)
        yaw = found.X_WB.yaw
        way = clock_s * np.array([0.25 * math.cos(yaw), 0.25 * math.sin(yaw), 0.3])
        added = found.covariance - plain.covariance
        np.testing.assert_allclose(added, own + shared + np.outer(way, way), rtol=0.1, atol=2e-8)
        assert (found.name, found.stamp_ns, found.shared is shared) == ("c", 2_100_000_000, True)


def test_a_body_that_drives_when_it_is_first_seen_is_known_after_three_frames() -> None:
    scene = Scene(twist=lambda t: Twist(0.35, 0.5))
    track = scene.run(0.25)
    assert track.motion is Motion.DRIVES
    assert np.abs(scene.error()[:2]).max() < 0.01
    np.testing.assert_allclose(track.state[3:], [0.35, 0.5], atol=0.1)


def test_measurements_of_a_body_that_stands_are_averaged_in_any_order() -> None:
    """Without drift n measurements leave R / n and their mean, also across the seam of the angle."""
    here = SE2(1.0, -0.5, 3.1415)
    errors = np.random.default_rng(8).multivariate_normal(np.zeros(3), CORRELATED, 20)
    measurements = [seen(i * NS // 10, here, e, CORRELATED) for i, e in enumerate(errors)]
    for order in (range(20), [0, *(1 + np.random.default_rng(2).permutation(19))]):
        track = BodyTrack.at_rest(measurements[0])
        for i in order[1:]:
            track = track.after(measurements[i], STILL)
        np.testing.assert_allclose(track.covariance[:3, :3], CORRELATED / 20, rtol=1e-9)
        pose = track.pose(0, STILL)
        np.testing.assert_allclose(pose_error(pose.X_WB, here), errors.mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(pose.covariance, CORRELATED / 20 + np.diag(LASTING**2), rtol=1e-9)
        assert pose.stamp_ns == track.seen.pose.stamp_ns == 19 * NS // 10


def test_what_stayed_the_same_while_a_body_stood_is_an_error_as_it_drives_off() -> None:
    """To its side, where no acceleration leads, it is known as well as two independent measurements say.

    The second one lies between the gates of a body that stands and of one that sets off.
    """
    slow = replace(STILL, limits=LIMITS.model_copy(update={"a_max_mps2": 1e-6, "dw_max_radps2": 1e-6}))
    track = BodyTrack.at_rest(seen(0, SE2()))
    for i in range(1, 20):
        track = track.after(seen(i * NS // 10, SE2()), slow)
    own, lasting, of_one = R[1, 1] / 20, LASTING[1] ** 2, R[1, 1]
    gate = chi2.ppf(slow.gate_probability, 3)
    aside = math.sqrt(gate * (own + of_one + 0.5 * lasting))
    moved = track.after(seen(2 * NS, SE2(0.0, aside, 0.0)), slow)
    assert (moved.motion, moved.rejected) == (Motion.DRIVES, 0)
    assert 1.0 / moved.covariance[1, 1] == pytest.approx(1.0 / (own + lasting) + 1.0 / of_one, rel=1e-6)
    at_once = moved.pose(2 * NS, slow).covariance
    np.testing.assert_allclose(at_once, moved.covariance[:3, :3], rtol=1e-6, atol=1e-18)


@pytest.mark.parametrize("drives", [False, True])
def test_a_measurement_that_is_delivered_again_tells_nothing(drives: bool) -> None:
    scene = Scene(twist=drives_after(0.0, 0.2, 0.3) if drives else lambda t: Twist())
    track = scene.run(1.01)
    assert (track.motion is Motion.DRIVES) == drives
    assert track.after(track.seen, NOISE) is track


@pytest.mark.parametrize("late", [False, True])
def test_measurements_delivered_again_after_newer_ones_tell_nothing(late: bool) -> None:
    """They were counted as others, and the body was taken to be known better than it was."""
    scene, measured = Scene(), [Scene(3).measured()]
    for step in range(1, 16):
        scene.step = 10 * step
        measured.append(scene.measured())
    if late:
        measured[7], measured[8] = measured[8], measured[7]
    once = again = BodyTrack.at_rest(measured[0])
    for before, new in itertools.pairwise(measured):
        once = once.after(new, NOISE)
        again = again.after(new, NOISE).after(before, NOISE)
    assert once.accepted == again.accepted == 16
    np.testing.assert_array_equal(again.covariance, once.covariance)
    np.testing.assert_array_equal(again.state, once.state)


def test_measurements_that_claim_to_be_exact_are_of_one_place_or_of_two() -> None:
    exact = [seen(k, SE2(0.1 * (k == 2), 0.0, 0.0), covariance=np.zeros((3, 3))) for k in range(3)]
    assert exact[0].is_at_place_of(exact[1])
    assert not exact[0].is_at_place_of(exact[2])


def test_what_arrives_late_is_no_sign_of_motion_and_does_not_disturb_a_drive() -> None:
    scene = Scene(twist=drives_after(1.0, 0.3, 0.0))
    late = scene.measured()
    driving = scene.run(2.05)
    assert driving.after(late, NOISE) is driving
    stands = BodyTrack.at_rest(seen(2 * NS, SE2(0.5, 0.0, 0.0)))
    assert stands.after(late, NOISE) is stands


def test_what_arrives_late_does_not_confirm_where_a_body_was_before_it_was_moved() -> None:
    track = Scene().run(2.05)
    moved = track.X_WB @ SE2(0.0, 0.05, 0.0)
    for k in (1, 2):
        track = track.after(seen(2 * NS + k * NS // 10, moved), NOISE)
    assert track.rejected == 2
    late = track.after(seen(track.seen.pose.stamp_ns - NS // 20, track.X_WB), NOISE)
    assert (late.accepted, late.rejected) == (track.accepted + 1, 2)
    anew = late.after(seen(2 * NS + 3 * NS // 10, moved), NOISE)
    assert (anew.rejected, anew.X_WB) == (0, moved)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_body_unseen_gets_uncertain_by_the_root_of_the_time(axis: int) -> None:
    track = BodyTrack.at_rest(seen(0, SE2()))
    at_once = track.pose(0, NOISE).covariance[axis, axis]
    slow = (NOISE.drift, NOISE.drift, NOISE.turn_drift)[axis] ** 2
    fast = (NOISE.unseen_drift, NOISE.unseen_drift, NOISE.unseen_turn_drift)[axis] ** 2
    for wait_s in (0.5, 1.0, 9.0):
        grown = track.pose(round(wait_s * NS), NOISE).covariance[axis, axis] - at_once
        expected = slow * wait_s + fast * max(wait_s - NOISE.unseen_after_s, 0.0)
        assert grown == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_the_limits_of_the_drive_are_two_standard_deviations_of_an_unknown_motion(yaw: float) -> None:
    """A frame later a body of which one pose is known may be where it drives in either direction."""
    track, dt = BodyTrack.at_any_speed(seen(0, SE2(0.3, -0.4, yaw)), LIMITS), 0.1
    P = track.pose(round(dt * NS), NOISE).covariance
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    way, turn = 0.5 * LIMITS.v_max_mps * dt, 0.5 * LIMITS.w_max_radps * dt
    assert math.sqrt(ahead @ P[:2, :2] @ ahead) == pytest.approx(way, rel=0.05)
    assert math.sqrt(P[2, 2]) == pytest.approx(turn, rel=0.05)
