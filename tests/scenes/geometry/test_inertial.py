"""Mass and inertia: bodies that are put together are those that they were cut from."""

from __future__ import annotations

from xml.etree.ElementTree import fromstring

import numpy as np

from msrr_scenes.geometry.inertial import Inertial
from msrr_scenes.geometry.se3 import SE3

X = SE3.from_xyz_rpy([0.3, -0.2, 0.1], [0.4, -0.3, 0.8])


def box(mass: float, x: float, y: float, z: float) -> Inertial:
    """A box about its middle."""
    return Inertial(mass, np.zeros(3), mass / 12.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y]))


def same(a: Inertial, b: Inertial) -> None:
    assert np.isclose(a.mass, b.mass)
    np.testing.assert_allclose(a.centre, b.centre, atol=1e-12)
    np.testing.assert_allclose(a.inertia, b.inertia, atol=1e-12)


def test_a_box_is_the_sum_of_its_parts_in_any_frame() -> None:
    whole, third, rest = box(3.0, 0.6, 0.2, 0.4), box(1.0, 0.2, 0.2, 0.4), box(2.0, 0.4, 0.2, 0.4)
    left, right = (SE3.from_xyz_rpy([x, 0.0, 0.0], [0.0, 0.0, 0.0]) for x in (-0.2, 0.1))
    same(third.in_frame(left) + rest.in_frame(right), whole)
    same(third.in_frame(X @ left) + rest.in_frame(X @ right), whole.in_frame(X))
    np.testing.assert_allclose(whole.in_frame(X).moments, np.sort(np.diag(whole.inertia)))


def test_a_bar_about_its_end_has_four_times_the_inertia_about_its_middle() -> None:
    bar = box(2.0, 0.6, 0.0, 0.0)
    np.testing.assert_allclose(bar.inertia_about(np.array([0.3, 0.0, 0.0])), 4.0 * bar.inertia, atol=1e-12)
    np.testing.assert_allclose(np.diag(bar.inertia_about(np.array([0.0, 0.1, 0.0]))), [0.02, 0.06, 0.08])


def test_an_inertial_is_read_in_the_frame_of_its_link() -> None:
    numbers = 'ixx="1" ixy="0.1" ixz="0.2" iyy="2" iyz="0.3" izz="2.5"'
    about = Inertial(4.0, np.zeros(3), np.array([[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 2.5]]))
    mass, inertia, origin = (
        '<mass value="4"/>',
        f"<inertia {numbers}/>",
        '<origin xyz="0.3 -0.2 0.1" rpy="0.4 -0.3 0.8"/>',
    )
    same(Inertial.of(fromstring(f"<inertial>{origin}{mass}{inertia}</inertial>")), about.in_frame(X))
    same(
        Inertial.of(fromstring(f"<inertial>{mass}</inertial>")), Inertial(4.0, np.zeros(3), np.zeros((3, 3)))
    )
    assert Inertial.of(fromstring(f"<inertial>{inertia}</inertial>")).mass == 0.0
