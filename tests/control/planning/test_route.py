import numpy as np
import pytest

from msrr_control.path_following.path import Path
from msrr_control.planning.route import Route, RouteSpec
from msrr_scenes.geometry.se2 import SE2

LINE = Path(np.zeros(3), np.array([0.0]), np.array([1.0]))


def test_a_path_ends_on_the_docking_axis_in_front_of_the_port_and_looks_at_it() -> None:
    end = RouteSpec(handover_m=0.5).handover(SE2(1.0, 2.0, 0.5 * np.pi))
    assert (end.x, end.y, end.yaw) == pytest.approx((1.0, 1.5, 0.5 * np.pi))


@pytest.mark.parametrize(("shape", "final"), [("arc", True), ("around", True), ("staged", False)])
def test_only_a_staged_route_does_not_end_in_front_of_the_port(shape: str, final: bool) -> None:
    assert Route(LINE, shape, {}, 1.0).final is final
