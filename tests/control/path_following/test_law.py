"""Properties that every long-distance law has."""

import numpy as np
import pytest

from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams
from msrr_control.path_following.c2 import C2PathFollowingLaw, C2PathFollowingParams
from msrr_control.path_following.obstacle_forces import Obstacles
from msrr_control.path_following.path import Path
from msrr_control.path_following.reference import SideWall
from msrr_scenes.specs.vehicle import LimitsSpec

NORMAL = LimitsSpec.model_validate({})


@pytest.mark.parametrize(
    "law",
    [
        C2PathFollowingLaw(C2PathFollowingParams(), NORMAL, 0.1),
        C1PathFollowingLaw(C1PathFollowingParams(), NORMAL, 0.1),
    ],
    ids=["c2", "c1"],
)
def test_the_mirrored_world_gives_the_mirrored_command(law: C2PathFollowingLaw | C1PathFollowingLaw) -> None:
    rng = np.random.default_rng(11)

    def drive(sign: float, pose: np.ndarray, middle: np.ndarray, normal: float) -> np.ndarray:
        flip = np.array([1.0, sign, sign])
        path = Path(np.zeros(3), np.array([sign * 0.8, 0.0]), np.array([1.5, 0.3]))
        wall = SideWall(np.array(True), middle * flip[:2], np.array(sign * normal))
        one = Obstacles((middle * flip[:2])[None], np.array([True]))
        state = law.start(pose * flip, np.zeros(2), 0.4)
        for _ in range(20):
            command, state = law.step(state, path, pose * flip, wall, one, 0.02)
        return command

    for _ in range(20):
        case = rng.uniform(-0.5, 0.5, 3), rng.uniform(-0.5, 0.5, 2), rng.uniform(-3.0, 3.0)
        np.testing.assert_allclose(drive(-1.0, *case), drive(1.0, *case) * [1, -1], atol=1e-9)
