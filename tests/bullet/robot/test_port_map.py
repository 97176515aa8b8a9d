"""How near a unit at a port may be to a neighbour, over all poses that its estimate leaves."""

import math

import numpy as np
import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_bullet.robot.local_map import OFFSET
from msrr_bullet.robot.port_map import PortMap
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ArenaEstimate, GlobalPose, MonitorState, PoseEstimate, Twist
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

SIGMAS = 2.0
PLAY = np.diag([0.0009**2, 0.0009**2, math.radians(0.2) ** 2])
#: Poses in D of units in their seats at the left and the right port of b, beside the rear port.
SEATS = {"c": SE2(0.1, 0.2, -math.pi / 2), "d": SE2(0.1, -0.2, math.pi / 2)}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "corner",
            "plant": "unicycle",
            "units": {name: {"number": i} for i, name in enumerate("abcd")},
            "cameras": {"overhead": {}},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


def at_port(scene: Scene, gap_m: float, lateral_m: float, yaw: float) -> SE2:
    offset = scene.geometry("a").control_offset("front")
    return SE2(-gap_m - offset * math.cos(yaw), lateral_m - offset * math.sin(yaw), yaw)


def covariance(scene: Scene, gap_m: float, lateral_m: float, yaw: float, correlation: float = 0.0) -> Array:
    """Return the covariance of the axle's pose for these standard deviations of the face's middle and yaw."""
    offset = scene.geometry("a").control_offset("front")
    P = np.diag([gap_m**2, lateral_m**2 + (offset * yaw) ** 2, yaw**2])
    P[1, 2] = P[2, 1] = -offset * yaw**2
    P[0, 1] = P[1, 0] = correlation * gap_m * lateral_m
    return P


@pytest.mark.parametrize(
    ("gap_m", "lateral_m", "yaw_deg", "correlation"),
    [
        (0.0075, 0.0, 0.0, 0.0),
        (0.0088, -0.0018, 0.3, 0.0),
        (0.0, 0.003, 1.0, 0.8),
        (0.03, 0.003, 1.0, -0.8),
        (0.05, 0.003, -1.0, -0.8),
    ],
)
@pytest.mark.parametrize("least_gap_m", [0.0, 0.012])
@pytest.mark.parametrize("names", ["c", "cd"])
def test_no_pose_that_matters_is_nearer_to_a_neighbour(
    gap_m: float,
    lateral_m: float,
    yaw_deg: float,
    correlation: float,
    least_gap_m: float,
    names: str,
    scene: Scene,
) -> None:
    """Of 1,500 poses on the ellipsoid of all errors, those nearer to the port than the gap left out."""
    X_DU = at_port(scene, gap_m, lateral_m, math.radians(yaw_deg))
    P = covariance(scene, 0.0077, 0.0055, math.radians(1.6), correlation)
    others = tuple(GlobalPose(name, 0, SEATS[name], PLAY) for name in names)
    model = ClearanceModel.from_scene(scene)
    reaches = {name: scene.geometry(name).circumradius for name in scene.units}
    offset = scene.geometry("a").control_offset("front")
    arena = ArenaEstimate(0, GlobalPose("a", 0, X_DU, P), None, others, (), 0)
    port_map = PortMap(model, arena, reaches, SIGMAS, offset, dict.fromkeys(names, least_gap_m))

    rng, factor = np.random.default_rng(0), np.linalg.cholesky(P)
    errors = rng.normal(size=(1500, 6))
    errors *= SIGMAS / np.linalg.norm(errors, axis=1, keepdims=True)
    nearest = math.inf
    for name in names:
        for error in errors:
            X = SE2(*(X_DU.as_array() + factor @ error[:3]).tolist())
            X_DN = SE2(*(SEATS[name].as_array() + np.sqrt(PLAY) @ error[3:]).tolist())
            if X.x + offset * math.cos(X.yaw) <= -least_gap_m:
                clearance = model.nearest("a", X @ OFFSET, {name: X_DN})
                assert clearance is not None
                nearest = min(nearest, clearance.distance)
    assert nearest - 0.0025 < port_map.distance(X_DU) < nearest + 0.0005  # to first order


def test_an_overlap_loses_what_other_maps_lose(scene: Scene) -> None:
    arena = ArenaEstimate(
        0, GlobalPose("a", 0, SEATS["c"], PLAY), None, (GlobalPose("c", 0, SEATS["c"], PLAY),), (), 0
    )
    model = ClearanceModel.from_scene(scene)
    reaches = {name: scene.geometry(name).circumradius for name in scene.units}
    port_map = PortMap(model, arena, reaches, SIGMAS, 0.1, {"c": 0.0})
    overlap = port_map.clearance(SEATS["c"])
    assert overlap is not None
    assert overlap.distance < 0.0
    assert port_map.distance(SEATS["c"]) == overlap.distance - SIGMAS * port_map.sigmas["c"]


@pytest.mark.parametrize(
    ("gap_m", "lateral_m", "off_seat_m", "state"),
    [
        (0.0075, 0.0, 0.0, MonitorState.FREE),
        (0.004, -0.003, 0.0, MonitorState.FREE),
        (0.030, 0.030, 0.0, MonitorState.STOP),  # it goes past the port
        (0.0075, 0.006, 0.016, MonitorState.STOP),  # no lock holds the neighbour there
    ],
)
def test_a_unit_that_knows_its_gap_badly_drives_on_beside_a_neighbour(
    gap_m: float, lateral_m: float, off_seat_m: float, state: MonitorState, scene: Scene
) -> None:
    """Robots of the grade ``rough`` stood at the port for good: two standard deviations are 15 mm there."""
    monitor = CollisionMonitor(scene, "a", scene.docks[0], [DockStep(unit="c", to="b.left")])
    X_DU, X_WD = at_port(scene, gap_m, lateral_m, 0.0), scene.geometry("b").dock_frame("rear")
    P = covariance(scene, 0.0077, 0.0055, math.radians(1.6))
    places = {"a": X_WD @ X_DU, "b": SE2(), "c": X_WD @ SEATS["c"] @ SE2(off_seat_m, 0.0)}
    a, b, c = (GlobalPose(name, 0, X, PLAY) for name, X in places.items())
    arena, sight = ArenaEstimate(0, a, b, (c,), (), 0), PoseEstimate(0, X_DU, P, 0)
    assert monitor.limit(Twist(0.02), arena, 0, True, sight).state is state
