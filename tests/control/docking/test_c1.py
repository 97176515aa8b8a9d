import numpy as np
import pytest
from pydantic import ValidationError

from msrr_control.docking.c1 import C1DockingLaw, C1DockingParams, LinearParams
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.feedback.composite import composite_feedback
from msrr_control.kinematics.controlled_point import offset_point, point_velocity
from msrr_scenes.specs.control import LosSpec
from msrr_scenes.specs.vehicle import LimitsSpec

FACTS = DockSetup(0.1, 0.0, 0.018, 0.015, (0.04, -0.04), LosSpec(), LimitsSpec.model_validate({}), 50.0)
LAW = C1DockingLaw(C1DockingParams(), FACTS)


def test_a_lost_target_pulls_nowhere() -> None:
    pose, rest = np.array([-0.5, 0.0, 0.0]), np.zeros(2)
    wide = np.array([0.5, 0.3])
    lost = LawInputs(pose, wide, np.array(0.0), rest)
    command, _ = LAW.step(LAW.start(lost), lost, 0.02)
    np.testing.assert_allclose(command, 0.0, atol=1e-12)
    seen = lost._replace(visibility=np.array(1.0))
    command, _ = LAW.step(LAW.start(seen), seen, 0.02)
    assert command[1] > 0.0


def test_every_switch_changes_what_it_names_and_nothing_else() -> None:
    """Where the cone is not touched and no limit bites, switching either off changes no command."""
    near = LawInputs(np.array([-0.5, 0.005, 0.0]), np.array([0.08, -0.08]), np.array(1.0), np.zeros(2))
    commands = []
    for params in (
        C1DockingParams(),
        C1DockingParams(los_correction=False),
        C1DockingParams(anti_windup=False),
    ):
        law = C1DockingLaw(params, FACTS)
        commands.append(law.step(law.start(near), near, 0.02)[0])
    np.testing.assert_array_equal(commands[1], commands[0])
    np.testing.assert_array_equal(commands[2], commands[0])
    linear = C1DockingLaw(LinearParams().as_c1(), FACTS)
    assert abs(linear.step(linear.start(near), near, 0.02)[0][1]) < abs(commands[0][1])


def test_the_controlled_point_moves_as_the_equations_say() -> None:
    """Eqs. 25 to 27 with an anti-windup state of either sign; the cone is not touched and no limit bites."""
    near = LawInputs(np.array([-0.5, 0.01, 0.3]), np.array([0.08, -0.08]), np.array(1.0), np.zeros(2))
    xi = np.array([0.2, -0.4])
    command, after = LAW.step(LAW.start(near)._replace(xi=xi), near, 0.02)
    windup = LAW.params.windup
    error = offset_point(near.pose, FACTS.offset) - LAW.reference(after) - windup.gamma_m * np.tanh(xi)
    velocity = composite_feedback(error, LAW.params.feedback) - windup.k_mps * xi
    velocity[0] += after.guidance.speed
    assert point_velocity(command, near.pose[2], FACTS.offset) == pytest.approx(velocity)


def test_an_anti_windup_that_would_cycle_is_refused() -> None:
    with pytest.raises(ValidationError, match="limit cycle"):
        C1DockingParams.model_validate({"windup": {"k_mps": 0.24, "gamma_m": 0.1}})
