import numpy as np
import pytest

from msrr_control.docking.graceful import GracefulLaw, GracefulParams
from msrr_control.docking.law import DockSetup


def test_on_the_axis_it_goes_straight(facts: DockSetup) -> None:
    law = GracefulLaw(GracefulParams(), facts)
    assert law.curvature(np.array([-0.6, 0.0, 0.0])) == pytest.approx(0.0)


def test_beside_the_axis_it_turns_towards_it_and_off_heading_back(facts: DockSetup) -> None:
    law = GracefulLaw(GracefulParams(), facts)
    assert law.curvature(np.array([-0.6, 0.1, 0.0])) < 0.0
    assert law.curvature(np.array([-0.6, 0.0, 0.3])) < 0.0
    assert law.curvature(np.array([-0.6, 0.0, -0.3])) > 0.0


def test_it_stays_bounded_at_the_goal_itself(facts: DockSetup) -> None:
    params = GracefulParams()
    law = GracefulLaw(params, facts)
    goal = np.array([params.ahead_m - facts.offset, 0.0, 0.0])
    poses = goal + np.random.default_rng(0).normal(0.0, 1e-6, size=(100, 3))
    assert np.all(np.isfinite(law.curvature(poses)))
    assert np.abs(law.curvature(poses)).max() < 1e3
