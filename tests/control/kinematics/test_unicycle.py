import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_control.kinematics.unicycle import slipping_twist


@given(st.floats(-0.4, 0.4), st.floats(-1.5, 1.5))
def test_slip_of_both_wheels_scales_and_of_one_turns(v: float, w: float) -> None:
    twist = np.array([v, w])
    np.testing.assert_allclose(slipping_twist(twist, np.array([1.0, 1.0]), 0.13), twist, atol=1e-12)
    np.testing.assert_allclose(slipping_twist(twist, np.array([0.9, 0.9]), 0.13), 0.9 * twist, atol=1e-12)
    turned = slipping_twist(np.array([0.2, 0.0]), np.array([1.0, 1.02]), 0.13)
    assert turned[1] == pytest.approx(0.2 * 0.02 / 0.13)
