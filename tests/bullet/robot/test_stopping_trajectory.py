"""What the guard knows of its surroundings: how uncertain a distance is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.robot.collision_monitor import CollisionMonitor, MonitorState
from msrr_bullet.robot.stopping_trajectory import Surroundings
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ArenaEstimate, GlobalPose, ObstacleEstimate, Twist
from msrr_scenes.specs.scene import Scene

POST = {"shape": "cylinder", "radius_m": 0.06, "height_m": 0.2, "tag_id": 500}
NOTHING = np.zeros((3, 3))
REACHES = {"a": 0.15, "b": 0.2, "post": 0.06}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "arena",
            "plant": "unicycle",
            "units": {"a": {"number": 0}, "b": {"number": 1}},
            "obstacles": {"post": POST},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


def _known(X_WA: SE2, own: np.ndarray, target: np.ndarray, post: np.ndarray) -> ArenaEstimate:
    return ArenaEstimate(
        0,
        GlobalPose("a", 0, X_WA, own),
        GlobalPose("b", 0, SE2(1.8, 1.3, 0.5), target),
        (),
        (ObstacleEstimate("post", 0, SE2(), post, 0.06),),
        0,
    )


def _sigma(scene: Scene, own: np.ndarray, target: np.ndarray = NOTHING, post: np.ndarray = NOTHING) -> float:
    return Surroundings(
        ClearanceModel.from_scene(scene), _known(SE2(-1.0, 0.0), own, target, post), REACHES
    ).sigma


@pytest.mark.parametrize(
    ("sigma_x", "sigma_y", "correlation", "sigma_yaw"),
    [
        (0.0, 0.0, 0.0, 0.05),
        (0.01, 0.01, 0.0, 0.0),
        (0.01, 0.01, 0.0, 0.1),
        (0.02, 0.004, 0.0, 0.02),
        (0.01, 0.008, 0.8, 0.06),
        (0.01, 0.008, -0.8, 0.06),
    ],
)
def test_it_is_that_of_the_point_and_direction_that_are_known_least(
    scene: Scene, sigma_x: float, sigma_y: float, correlation: float, sigma_yaw: float
) -> None:
    """Draws of the pose move the points of the unit's rim: none strays more in any direction, one as much.

    20000 draws: the standard error of a standard deviation is 0.5 %, and the turn is small enough for its
    sine and cosine.
    """
    P = np.diag([sigma_x**2, sigma_y**2, sigma_yaw**2])
    P[0, 1] = P[1, 0] = correlation * sigma_x * sigma_y
    x, y, yaw = np.random.default_rng(6).multivariate_normal(np.zeros(3), P, 20_000).T
    directions = np.linspace(0.0, math.pi, 61)
    worst = 0.0
    for at in np.linspace(0.0, 2.0 * math.pi, 25):
        px = x + REACHES["a"] * (np.cos(at + yaw) - math.cos(at))
        py = y + REACHES["a"] * (np.sin(at + yaw) - math.sin(at))
        worst = max(worst, *(float(np.std(math.cos(d) * px + math.sin(d) * py)) for d in directions))
    assert _sigma(scene, P) == pytest.approx(worst, rel=0.025)


def test_known_uncertainties(scene: Scene) -> None:
    """A turn counts by the length of the body; of the others the one that is known least counts."""
    turn = np.diag([0.0, 0.0, 0.1**2])
    assert _sigma(scene, turn) == pytest.approx(0.015)  # 0.15 m x 0.1
    assert _sigma(scene, NOTHING, target=turn) == pytest.approx(0.02)
    assert _sigma(scene, NOTHING, post=turn) == pytest.approx(0.006)
    assert _sigma(scene, turn, target=turn, post=turn) == pytest.approx(math.hypot(0.015, 0.02))
    place = np.diag([0.03**2, 0.0, 0.0])
    assert _sigma(scene, place, target=turn) == pytest.approx(math.hypot(0.03, 0.02))
    assert _sigma(scene, place + turn) == pytest.approx(math.hypot(0.03, 0.015))


def test_the_guard_takes_an_uncertain_heading_off_the_clearance(scene: Scene) -> None:
    """4 deg of heading are 9 mm at the corner of a unit, and 18 mm at two standard deviations."""
    X_WA, wish = SE2(-0.06 - 0.118 - 0.05, 0.0, 0.0), Twist(0.15)
    turn = np.diag([0.0, 0.0, math.radians(4.0) ** 2])
    sure, unsure = (
        CollisionMonitor(scene, scene.plan[0]).limit(wish, _known(X_WA, P, NOTHING, NOTHING), 0)
        for P in (NOTHING, turn)
    )
    assert sure.state is MonitorState.FREE
    assert unsure.state is not MonitorState.FREE
    reach = scene.geometry("a").circumradius
    expected = scene.control.guard.sigmas * reach * math.radians(4.0)
    assert sure.ahead - unsure.ahead == pytest.approx(expected, abs=0.002)
