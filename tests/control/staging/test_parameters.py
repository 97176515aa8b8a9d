from msrr_control.path_following.c1 import C1PathFollowingParams
from msrr_control.path_following.c2 import C2PathFollowingParams
from msrr_control.staging.parameters import AssemblyParams, C2AssemblyParams, RouteFollowingParams


def test_an_assembler_takes_the_parameters_of_its_law_and_those_of_the_routes() -> None:
    for kind, law in ((AssemblyParams, C1PathFollowingParams), (C2AssemblyParams, C2PathFollowingParams)):
        params = kind()
        assert set(kind.model_fields) == set(law.model_fields) | set(RouteFollowingParams.model_fields)
        assert all(getattr(params, name) == getattr(law(), name) for name in law.model_fields)


def test_c2_waits_for_nobody_and_may_stray_further() -> None:
    c1, c2 = AssemblyParams(), C2AssemblyParams()
    assert c2.pace.lag_m > c1.pace.lag_m
    assert c2.watch.astray_m > c1.watch.astray_m
