"""The paper's stability proofs along trials: they hold where their assumptions do, and nowhere else."""

import pytest

from msrr_bullet.studies.model import StabilityCheck
from msrr_bullet.studies.settings import NO_LAG, STANDARD
from msrr_bullet.studies.stability import stability_checks


@pytest.fixture(scope="module")
def assumed() -> dict[int, StabilityCheck]:
    """The checks by equation where the drive follows at once: 30 trials at a fixed seed, no chance."""
    return {check.equation: check for check in stability_checks((NO_LAG, range(30)))}


@pytest.mark.parametrize("equation", [13, 20, 29])
def test_v_falls_as_proved_where_the_assumptions_hold(assumed, equation: int) -> None:
    free = assumed[equation].conditions["none of the following"]
    assert free.time > 0.03
    assert free.falls >= 0.99
    assert free.proved >= 0.99


def test_a_clamped_state_voids_eq_13(assumed) -> None:
    """Beside an obstacle lambda_phi is at its clamp nearly all the time, and V rises."""
    clamped, wall = (assumed[13].conditions[name] for name in ("a state at its clamp", "a wall or a spring"))
    assert clamped.proved < 0.05
    assert clamped.falls < 0.5
    assert clamped.time > 0.9 * wall.time


def test_a_spring_may_raise_v_within_what_eq_20_allows(assumed) -> None:
    pushed = assumed[20].conditions["a wall or a spring"]
    assert pushed.falls < 0.9
    assert pushed.proved >= 0.99


def test_lag_and_noise_void_eqs_20_and_29() -> None:
    for check in stability_checks((STANDARD, range(30))):
        whole = check.conditions["always"]
        assert whole.time == 1.0
        assert (whole.proved < 0.9) or check.equation == 13
