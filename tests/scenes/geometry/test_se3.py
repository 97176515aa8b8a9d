"""SE(3): the laws of a group, quaternions, Euler angles of URDF, and the way to and from the plane."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy

metres = st.floats(-10.0, 10.0)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(
    lambda x, y, z, r, p, w: SE3.from_xyz_rpy([x, y, z], [r, p, w]),
    metres,
    metres,
    metres,
    angles,
    angles,
    angles,
)


def close(a: SE3, b: SE3) -> bool:
    return np.allclose(a.matrix(), b.matrix(), atol=1e-9)


@given(poses, poses, poses)
def test_composition_is_associative(a: SE3, b: SE3, c: SE3) -> None:
    assert close((a @ b) @ c, a @ (b @ c))


@given(poses)
def test_identity_and_inverse(a: SE3) -> None:
    assert close(a @ SE3(), a)
    assert close(a @ a.inverse(), SE3())
    assert close(a.inverse() @ a, SE3())


@given(poses, poses)
def test_acting_agrees_with_the_homogeneous_matrix(a: SE3, b: SE3) -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, -2.0, 3.0]])
    homogeneous = np.concatenate([points, np.ones((2, 1))], axis=1)
    expected = (homogeneous @ (a.matrix() @ b.matrix()).T)[:, :3]
    np.testing.assert_allclose((a @ b).act(points), expected, atol=1e-8)


@given(angles, angles, angles)
def test_rotations_are_rotations(roll: float, pitch: float, yaw: float) -> None:
    R = rotation_from_rpy(roll, pitch, yaw)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert math.isclose(float(np.linalg.det(R)), 1.0, abs_tol=1e-12)


@given(angles, angles | st.sampled_from([math.pi / 2, -math.pi / 2]), angles)
def test_roll_pitch_and_yaw_come_back(roll: float, pitch: float, yaw: float) -> None:
    X = SE3.from_xyz_rpy([0.0, 0.0, 0.0], [roll, pitch, yaw])
    assert close(SE3.from_xyz_rpy([0.0, 0.0, 0.0], X.rpy()), X)


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4))
def test_quaternions_come_back(q: list[float]) -> None:
    norm = float(np.linalg.norm(q))
    assume(norm > 1e-3)
    back = SE3.from_quaternion_xyzw([0.0, 0.0, 0.0], q).quaternion_xyzw()
    assert back[3] >= 0.0
    np.testing.assert_allclose(abs(float(np.dot(back, np.array(q) / norm))), 1.0, atol=1e-9)


def test_quaternion_is_ordered_x_y_z_w() -> None:
    quarter_yaw = SE3.from_quaternion_xyzw([0.0, 0.0, 0.0], [0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)])
    np.testing.assert_allclose(quarter_yaw.act([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0], atol=1e-12)


def test_rpy_turns_about_fixed_axes_in_the_order_of_urdf() -> None:
    R = rotation_from_rpy(math.pi / 2, 0.0, math.pi / 2)  # first about x, then about the old z
    np.testing.assert_allclose(R @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(R @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-12)


@given(metres, metres, angles, metres)
def test_the_plane_lifts_and_projects_back(x: float, y: float, yaw: float, z: float) -> None:
    X = SE2(x, y, yaw)
    lifted = SE3.from_se2(X, z)
    assert lifted.p[2] == z
    np.testing.assert_allclose(
        lifted.to_se2().inverse().act(X.act([[0.0, 0.0], [1.0, 0.0]])), [[0, 0], [1, 0]], atol=1e-9
    )


def test_arrays_of_a_pose_cannot_be_written() -> None:
    X = SE3.from_xyz_rpy([1.0, 2.0, 3.0], [0.0, 0.0, 0.0])
    for array in (X.R, X.p):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
