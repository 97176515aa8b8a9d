import numpy as np
import pytest

from msrr_control.docking.law import DockSetup
from msrr_control.docking.retreat import RetreatSpec, retreat_twist
from msrr_control.kinematics.controlled_point import offset_point, point_velocity, twist_for

SPEC = RetreatSpec()


def _back_out(poses: np.ndarray, facts: DockSetup, distance: float = 0.45, steps: int = 600) -> np.ndarray:
    """Ideal unicycles; returns the poses of every step, shape (steps, trials, 3)."""
    path = [poses]
    for _ in range(steps):
        v, w = np.moveaxis(retreat_twist(poses, distance, SPEC, facts), -1, 0)
        yaw = poses[:, 2]
        poses = poses + 0.02 * np.stack([v * np.cos(yaw), v * np.sin(yaw), w], axis=1)
        path.append(poses)
    return np.array(path)


def test_it_ends_on_the_axis_and_straight(facts: DockSetup) -> None:
    rng = np.random.default_rng(7)
    starts = rng.uniform([-0.30, -0.03, -0.15], [-0.12, 0.03, 0.15], size=(200, 3))
    path = _back_out(starts, facts)
    gap = -offset_point(path[-1], facts.offset)[:, 0]
    np.testing.assert_allclose(gap, 0.45, atol=0.01)
    assert np.all(np.abs(path[-1, :, 1]) < 0.01)
    assert np.all(np.abs(path[-1, :, 2]) < np.radians(6.0))


def test_the_heading_stays_such_that_the_marker_can_be_seen(facts: DockSetup) -> None:
    starts = np.array([[-0.118, 0.012, 0.1], [-0.118, -0.012, 0.1], [-0.2, 0.05, -0.2]])
    path = _back_out(starts, facts)
    assert np.degrees(np.abs(path[..., 2]).max()) < 25.0


def test_one_degree_does_not_grow(facts: DockSetup) -> None:
    """With the point ahead of the axle 1 deg becomes tens of degrees in 0.4 m; with the rear one it fades."""
    start = np.array([[-0.13, 0.0, np.radians(1.0)]])
    assert np.degrees(np.abs(_back_out(start, facts)[-1, 0, 2])) < 1.0
    pose = start[0]
    for _ in range(170):
        v, w = twist_for(np.array([-0.12, -offset_point(pose, 0.1)[1]]), pose[2], 0.1)
        pose = pose + 0.02 * np.array([v * np.cos(pose[2]), v * np.sin(pose[2]), w])
    assert np.degrees(abs(pose[2])) > 20.0


def test_the_pins_leave_their_holes_without_steering(facts: DockSetup) -> None:
    twist = retreat_twist(np.array([-0.101, 0.004, 0.05]), 0.45, SPEC, facts)
    assert twist == pytest.approx([-SPEC.speed_mps, 0.0])
    out_m = facts.pin_reach + SPEC.clear_m
    for gap, steers in ((out_m - 0.001, False), (out_m + 0.001, True)):
        _, w = retreat_twist(np.array([-facts.offset - gap, 0.004, 0.0]), 0.45, SPEC, facts)
        assert bool(w != 0.0) is steers


def test_the_rear_point_is_led_to_the_axis_and_brakes_before_the_end(facts: DockSetup) -> None:
    for y, remaining in ((0.01, 0.2), (-0.02, 0.01), (0.3, 0.2)):
        pose = np.array([-facts.offset - 0.45 + remaining, y, 0.1])
        twist = retreat_twist(pose, 0.45, SPEC, facts)
        rear = offset_point(pose, -facts.offset)
        gap = -offset_point(pose, facts.offset)[0]
        speed = min(SPEC.speed_mps, np.sqrt(2.0 * SPEC.stop_mps2 * (0.45 - gap)))
        aside = np.clip(-SPEC.k_per_s * rear[1], -SPEC.slant * speed, SPEC.slant * speed)
        assert point_velocity(twist, pose[2], -facts.offset) == pytest.approx([-speed, aside])


def test_there_it_stops(facts: DockSetup) -> None:
    assert retreat_twist(np.array([-0.60, 0.01, 0.1]), 0.45, SPEC, facts) == pytest.approx([0.0, 0.0])
