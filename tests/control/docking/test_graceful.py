import math

import numpy as np
import pytest

from msrr_control.docking.graceful import GracefulLaw, GracefulParams
from msrr_control.docking.guidance import guidance_step
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.kinematics.controlled_point import offset_point
from msrr_control.kinematics.unicycle import advance_pose


def test_the_heading_falls_onto_the_curve_as_the_paper_designs_it(facts: DockSetup) -> None:
    """z = delta - atan(-k1 theta) obeys z' = -(v/r) k2 z for the motion of a unicycle, by differences."""
    params = GracefulParams()
    law, goal = GracefulLaw(params, facts), params.ahead_m - facts.offset

    def off_the_curve(pose: np.ndarray) -> tuple[float, float]:
        line = math.atan2(-pose[1], goal - pose[0])
        delta = math.remainder(pose[2] - line, 2.0 * math.pi)
        return delta - math.atan(params.k1 * line), math.hypot(goal - pose[0], pose[1])

    rng, h = np.random.default_rng(5), 1e-6
    for pose in rng.uniform([-0.8, -0.2, -1.0], [-0.2, 0.2, 1.0], (50, 3)):
        turn = h * float(law.curvature(pose))
        ahead, behind = (advance_pose(pose, np.array(s * h), np.array(s * turn)) for s in (1.0, -1.0))
        z, r = off_the_curve(pose)
        rate = (off_the_curve(ahead)[0] - off_the_curve(behind)[0]) / (2.0 * h)
        assert rate == pytest.approx(-params.k2 * z / r, rel=1e-4, abs=1e-6)


def test_a_curve_is_taken_slower_by_as_much_as_it_bends(facts: DockSetup) -> None:
    params = GracefulParams(slow_down=0.3, sharpness=1.5)
    law, pose = GracefulLaw(params, facts), np.array([-0.6, 0.05, 0.1])
    inputs = LawInputs(pose, np.zeros(2), np.array(1.0), np.zeros(2))
    before = law.start(inputs)
    tip = offset_point(pose, facts.offset)
    guidance = guidance_step(before, tip, inputs.visibility, params.guidance, facts.pin_reach, 0.02)
    bend = float(law.curvature(pose))
    speed = guidance.speed / (1.0 + 0.3 * abs(bend) ** 1.5)
    twist, after = law.step(before, inputs, 0.02)
    assert abs(bend) > 1.0
    assert after == guidance
    assert twist == pytest.approx([speed, bend * speed])
    # A reference ahead of the unit comes back to it: the law takes only its speed.
    assert law.step(before._replace(x=before.x + 0.05), inputs, 0.02)[1] == guidance


def test_it_stays_bounded_at_the_goal_itself(facts: DockSetup) -> None:
    params = GracefulParams()
    law = GracefulLaw(params, facts)
    goal = np.array([params.ahead_m - facts.offset, 0.0, 0.0])
    poses = goal + np.random.default_rng(0).normal(0.0, 1e-6, size=(100, 3))
    assert np.all(np.isfinite(law.curvature(poses)))
    # Nearer than half of the way by which the goal is beyond the seat, the distance counts as that half.
    most = params.k2 * (math.pi + math.pi / 2) + 1.0 + params.k1
    assert np.abs(law.curvature(poses)).max() < most / (0.5 * params.ahead_m)
