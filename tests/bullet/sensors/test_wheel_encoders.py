"""Wheel encoders: resolution, scale errors, noise, and what a seed determines."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_bullet.sensors.wheel_encoders import WheelEncoders
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.sensors import OdometrySpec


def encoders(seed=0, **keys):
    return WheelEncoders("a", OdometrySpec(**keys), stream(seed, "unit/a/odometry"))


@given(st.lists(st.tuples(st.floats(-40, 40), st.floats(-40, 40)), min_size=1, max_size=20))
def test_ideal_encoders_measure_the_angle_to_one_tick(angles):
    encoder = encoders(scale_error=0.0, noise_rad=0.0, ticks_per_turn=1000)
    tick = 2 * math.pi / 1000
    for k, (left, right) in enumerate(angles):
        reading = encoder.read((left, right), k)
        for angle, start, measured in (
            (left, angles[0][0], reading.left),
            (right, angles[0][1], reading.right),
        ):
            assert -1e-9 <= (angle - start) - measured < tick + 1e-9
            assert abs(measured / tick - round(measured / tick)) < 1e-6
        assert (reading.unit, reading.stamp_ns) == ("a", k)


def test_the_reading_of_a_wheel_at_rest_does_not_change():
    encoder = encoders()
    assert {(r.left, r.right) for r in (encoder.read((3.0, -2.0), k) for k in range(50))} == {(0.0, 0.0)}


def test_an_encoder_that_is_stuck_tells_the_same_angle_and_changes_nothing_else():
    stuck = WheelEncoders("a", OdometrySpec(), stream(0, "unit/a/odometry"), (5.0, math.inf))
    sound, readings = encoders(), []
    for k in range(10):
        readings.append((stuck.read((0.3 * k, 0.2 * k), k), sound.read((0.3 * k, 0.2 * k), k)))
    assert all(a.right == b.right for a, b in readings)
    assert all(a.left == b.left for a, b in readings[:5])
    assert {a.left for a, _ in readings[5:]} == {readings[4][0].left}


def test_scale_errors_are_drawn_once_per_trial_with_the_spread_of_the_spec():
    """The deviation of 400 normal draws is within 15 % of the true one but for 1 case in 10^4."""
    errors = np.array([encoders(seed, scale_error=0.02).scale for seed in range(200)]).ravel() - 1.0
    assert errors.std() == pytest.approx(0.02, rel=0.15)
    encoder = encoders(3, noise_rad=0.0, ticks_per_turn=1_000_000)
    encoder.read((0.0, 0.0), 0)
    reading = encoder.read((100.0, -100.0), 1)
    assert (reading.left / 100.0, -reading.right / 100.0) == pytest.approx(encoder.scale, abs=1e-6)


def test_noise_grows_with_the_angle_turned_however_often_it_is_read():
    """Deviation of 300 runs within 17 % (4 sigma, 1 in 10^4) of noise x sqrt(angle), in 5 or 500 readings."""
    for readings in (5, 500):
        ends = []
        for seed in range(150):
            encoder = encoders(seed, scale_error=0.0, noise_rad=0.01, ticks_per_turn=10_000_000)
            for k in range(readings + 1):
                reading = encoder.read((9.0 * k / readings, -9.0 * k / readings), k)
            ends += [reading.left - 9.0, reading.right + 9.0]
        assert np.std(ends) == pytest.approx(0.01 * 3.0, rel=0.17)


def test_the_readings_are_determined_by_the_seed():
    path = [(0.01 * k, 0.012 * k) for k in range(100)]
    first, second = ([e.read(p, k) for k, p in enumerate(path)] for e in (encoders(5), encoders(5)))
    assert first == second
    assert first != [encoders(6).read(p, k) for k, p in enumerate(path)]
