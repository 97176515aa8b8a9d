import pytest

from msrr_control.parameters import read_params
from msrr_control.path_following.c1 import C1PathFollowingParams
from msrr_scenes.errors import ParameterError


def test_parameters_are_checked_and_completed() -> None:
    params = read_params(C1PathFollowingParams, {"pace": {"cruise_mps": 0.2}})
    assert params.pace.cruise_mps == 0.2
    assert params.guidance == C1PathFollowingParams().guidance


@pytest.mark.parametrize(
    ("params", "says"),
    [
        ({"pase": {}}, "pase: unknown parameter; did you mean 'pace'?"),
        (
            {"guidance": {"envelope": {"gama": 1.0}}},
            "guidance.envelope.gama: unknown parameter; did you mean",
        ),
        (
            {"pace": {"ramp_s": -1.0}},
            "pace.ramp_s: Input should be greater than or equal to 0.001",
        ),
        ({"pace": {"ramp_s": 0, "5": None}}, "pace.5: unknown parameter; a decimal fraction has a point"),
        ({"guidance": {"u_max_mps2": 0.1}}, "guidance: envelope.gamma = 0.28 m/s2 has to be less than"),
    ],
)
def test_a_fault_is_named_with_its_place_and_the_nearest_valid_name(params, says: str) -> None:
    with pytest.raises(ParameterError) as caught:
        read_params(C1PathFollowingParams, params)
    assert says in str(caught.value)


def test_all_faults_are_named_at_once() -> None:
    with pytest.raises(ParameterError) as caught:
        read_params(C1PathFollowingParams, {"pase": {}, "pace": {"ramp_s": 0.0}})
    assert caught.value.faults.keys() == {"pase", "pace.ramp_s"}
