"""What a docking unit may come near to besides its target: a unit that is locked to the target's side."""

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.robot.close_neighbours import CloseNeighbours
from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_bullet.sensors.calibrated_sight import OverheadSight
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.tracking.arena_tracker import ArenaTracker
from msrr_scenes.arrays import Array
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ArenaEstimate, GlobalPose, MonitorState, PoseEstimate, Twist
from msrr_scenes.messages.coordination import Authority
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none

DRAWS = 10
SURE = np.diag([0.0003**2, 0.0003**2, 1e-7])

#: Covariance of what robots of the grade rough see from above.
ROUGH = np.diag([0.0012**2, 0.0012**2, 0.021**2])

#: Unit c in its seat at the left port of b, in the dock frame D of the rear port of b.
X_DC = SE2(0.1, 0.2, -np.pi / 2)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "corner",
            "plant": "unicycle",
            "units": {name: {"number": i} for i, name in enumerate("abc")},
            "cameras": {"overhead": {}},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


def decide(
    scene: Scene,
    X_DU: SE2,
    docking: bool = True,
    X_DC: SE2 = X_DC,
    by_sight: bool = False,
    sigma_m: float = 0.0003,
) -> MonitorState:
    """Return the state of the monitor of unit a at a pose, which wants to drive on at 5 cm/s."""
    monitor = CollisionMonitor(scene, "a", scene.docks[0], [DockStep(unit="c", to="b.left")])
    X_WD = scene.geometry("b").dock_frame("rear")
    a, b, c = (GlobalPose(n, 0, X, SURE) for n, X in (("a", X_WD @ X_DU), ("b", SE2()), ("c", X_WD @ X_DC)))
    sight = PoseEstimate(0, X_DU, np.diag([sigma_m**2, sigma_m**2, 1e-7]), 0) if by_sight else None
    return monitor.limit(Twist(0.05), ArenaEstimate(0, a, b, (c,), (), 0), 0, docking, sight).state


@pytest.mark.parametrize(
    ("gap_m", "docking", "state"),
    [(0.027, False, MonitorState.STOP), (0.027, True, MonitorState.FREE), (0.010, True, MonitorState.STOP)],
)
def test_a_neighbour_may_be_nearer_than_other_bodies_while_the_unit_docks(
    scene: Scene, gap_m: float, docking: bool, state: MonitorState
) -> None:
    """It drives at the side of the neighbour, which is 23 mm from the seat; 30 mm are kept from others."""
    front = scene.geometry("a").footprint[:, 0].max()
    assert decide(scene, SE2(-gap_m - float(front), 0.2, 0.0), docking) is state


@pytest.mark.parametrize("by_sight", [False, True])
@pytest.mark.parametrize(("off_m", "known_by_its_lock"), [(0.010, True), (0.020, False)])
def test_a_neighbour_in_its_seat_is_where_its_lock_holds_it(
    scene: Scene, off_m: float, known_by_its_lock: bool, by_sight: bool
) -> None:
    """Before the holes, 1 cm off their axis, a unit that sees the port passes a tag that is 14 mm off."""
    before_holes = SE2(-scene.geometry("a").control_offset("front") - 0.019, 0.010)
    assert decide(scene, before_holes, by_sight=by_sight) is MonitorState.FREE
    seen_at = X_DC @ SE2(off_m, -off_m)
    passes = by_sight and known_by_its_lock
    assert (decide(scene, before_holes, X_DC=seen_at, by_sight=by_sight) is MonitorState.FREE) is passes


@pytest.mark.parametrize(
    ("gap_m", "sigma_m", "X_DC", "passes"),
    [
        (0.004, 0.005, X_DC, True),
        (0.010, 0.010, X_DC, True),  # where the pins are still before the holes, it is far enough away
        (0.004, 0.005, X_DC @ SE2(0.020, -0.020), False),  # no lock holds the neighbour there
    ],
)
def test_a_unit_in_the_holes_presses_on_beside_a_neighbour_in_its_seat(
    scene: Scene, gap_m: float, sigma_m: float, X_DC: SE2, passes: bool
) -> None:
    """It sees itself 7 mm beside the axis, where the holes cannot let it be."""
    X_DU = SE2(-scene.geometry("a").control_offset("front") - gap_m, 0.007)
    state = decide(scene, X_DU, X_DC=X_DC, by_sight=True, sigma_m=sigma_m)
    assert (state is MonitorState.FREE) is passes


@pytest.mark.parametrize("off_m", [0.0, 0.03])
def test_where_the_world_begins_does_not_matter(scene: Scene, off_m: float) -> None:
    """A neighbour in its seat is where its lock holds it, and another one where it is seen."""
    joints = [DockStep(unit="c", to="b.left")]
    neighbours = CloseNeighbours(scene, ClearanceModel.from_scene(scene), scene.docks[0], joints, 0.03, 3.0)
    assert neighbours.limits.keys() == {"c"}
    X_WD, uneven = scene.geometry("b").dock_frame("rear"), np.diag([1e-4, 4e-6, 1e-5])
    sight = PoseEstimate(0, SE2(-0.5, 0.01, 0.02), SURE, 0)
    found = []
    for X_VW in (SE2(), SE2(1.3, -0.7, 2.0)):
        turn = np.eye(3)
        turn[:2, :2] = [[np.cos(X_VW.yaw), -np.sin(X_VW.yaw)], [np.sin(X_VW.yaw), np.cos(X_VW.yaw)]]
        covariance = turn @ uneven @ turn.T
        own, target, other, far = (
            GlobalPose(name, 0, X_VW @ X, covariance)
            for name, X in (("a", SE2()), ("b", SE2()), ("c", X_WD @ X_DC @ SE2(off_m)), ("far", SE2(3.0)))
        )
        arena = neighbours.in_dock_frame(ArenaEstimate(0, own, target, (other, far), (), 0), sight)
        (one,) = arena.others
        assert (one.name, arena.own.X_WB) == ("c", sight.X_DU)
        found.append((one.X_WB.as_array(), one.covariance))
    np.testing.assert_allclose(found[0][0], (X_DC @ SE2(off_m)).as_array(), atol=1e-12)
    np.testing.assert_allclose(found[1][0], found[0][0], atol=1e-12)
    np.testing.assert_allclose(found[1][1], found[0][1], atol=1e-12)
    if off_m:  # in the first world the target stands at the origin, and x of D is that of W
        x, y, _ = (X_WD @ X_DC @ SE2(off_m)).as_array()
        by_target = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
        expected = uneven + by_target @ uneven @ by_target.T
        np.testing.assert_allclose(found[0][1], expected, atol=1e-12)


def test_a_neighbour_that_is_not_in_its_seat_is_known_as_well_as_the_overhead_camera_tells(
    scene: Scene,
) -> None:
    """10 draws of rough cameras and tags, and a neighbour some centimetres from its seat, anywhere.

    The sum of the normalised errors squared, of 3 degrees of freedom each, leaves its bounds in 1 of 10,000
    sets of draws. Their mean is 3.0. Without the errors of the target it would be 28, without those of the
    camera 10, and without both 45.
    """
    rough = Scene.model_validate(scene.model_dump() | {"as_built": "rough"})
    told, rng, squares = rough.told(), np.random.default_rng(0), 0.0
    joints = [DockStep(unit="c", to="b.left")]
    neighbours = CloseNeighbours(told, ClearanceModel.from_scene(told), told.docks[0], joints, 0.03, 3.0)
    model, X_TD = OverheadModel.from_scene(told, ()), scene.geometry("b").dock_frame("rear")
    sight = PoseEstimate(0, SE2(-0.5), SURE, 0)
    for seed in range(DRAWS):
        camera, tracker = OverheadSight(rough, draw_as_built(rough, seed)), ArenaTracker(model)
        X_WT = SE2(*rng.uniform([-0.5, -0.3, -3.0], [0.5, 0.3, 3.0]).tolist())
        X_DN = X_DC @ SE2(*rng.uniform([-0.09, -0.02, -0.3], [-0.06, 0.02, 0.3]).tolist())
        for name, X_WB in {"b": X_WT, "c": X_WT @ X_TD @ X_DN}.items():
            seen = GlobalPose(name, 0, not_none(camera.see(name, X_WB)), np.diag([1e-10, 1e-10, 1e-8]))
            tracker.add(tracker.locate(seen).poses[0])
        poses = tracker.poses(0)
        arena = ArenaEstimate(0, GlobalPose("a", 0, SE2(), SURE), poses["b"], (poses["c"],), (), 0)
        (found,) = neighbours.in_dock_frame(arena, sight).others
        e = found.X_WB.as_array() - X_DN.as_array()
        squares += float(e @ np.linalg.solve(found.covariance, e))
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], 3 * DRAWS)
    assert low < squares < high


@pytest.mark.parametrize(
    ("x_m", "y_m", "yaw_deg", "in_seat"),
    [
        (0.0, -0.014, 0.0, True),
        (-0.016, 0.0, 0.0, False),
        (0.0, 0.0, 5.0, False),
        (0.0, 0.0, -5.0, False),
        (0.009, 0.009, 3.5, True),
        (-0.009, -0.009, 3.5, True),
        (0.009, -0.009, -3.5, True),
    ],
)
def test_a_neighbour_is_in_its_seat_by_place_and_heading_as_seen_from_there(
    x_m: float, y_m: float, yaw_deg: float, in_seat: bool, scene: Scene
) -> None:
    joints = [DockStep(unit="c", to="b.left")]
    neighbours = CloseNeighbours(scene, ClearanceModel.from_scene(scene), scene.docks[0], joints, 0.03, 3.0)
    X_WD, seen = scene.geometry("b").dock_frame("rear"), X_DC @ SE2(x_m, y_m, np.radians(yaw_deg))
    a, b, c = (GlobalPose(n, 0, X, SURE) for n, X in (("a", SE2()), ("b", SE2()), ("c", X_WD @ seen)))
    sight = PoseEstimate(0, SE2(-0.5, 0.01, 0.02), SURE, 0)
    (found,) = neighbours.in_dock_frame(ArenaEstimate(0, a, b, (c,), (), 0), sight).others
    expected = X_DC if in_seat else seen
    np.testing.assert_allclose(found.X_WB.as_array(), expected.as_array(), atol=1e-3)


@pytest.mark.parametrize(
    ("off", "covariance", "in_seat"),
    [
        (SE2(0.0057, 0.0104, np.radians(-4.7)), ROUGH, True),
        (SE2(0.0057, 0.0104, np.radians(-4.7)), 0.1 * ROUGH, False),
        (SE2(0.0, 0.025), ROUGH, False),
        (SE2(0.0, 0.050), 100.0 * ROUGH, False),
        (SE2(0.0, 0.0, np.radians(13.0)), 100.0 * ROUGH, False),
    ],
)
def test_a_neighbour_is_in_its_seat_as_far_as_sight_can_tell(
    off: SE2, covariance: Array, in_seat: bool, scene: Scene
) -> None:
    """Robots of the grade rough saw one 5 deg askew in its seat, and did not dock beside it."""
    joints, X_DN = [DockStep(unit="c", to="b.left")], X_DC @ off
    neighbours = CloseNeighbours(scene, ClearanceModel.from_scene(scene), scene.docks[0], joints, 0.03, 3.0)
    for X_VW in (SE2(), SE2(1.3, -0.7, 2.0)):
        places = {"a": SE2(), "b": X_VW, "c": X_VW @ scene.geometry("b").dock_frame("rear") @ X_DN}
        a, b, c = (GlobalPose(n, 0, X, X_VW.rotate_covariance(covariance)) for n, X in places.items())
        sight = PoseEstimate(0, SE2(-0.5, 0.01, 0.02), SURE, 0)
        (found,) = neighbours.in_dock_frame(ArenaEstimate(0, a, b, (c,), (), 0), sight).others
        expected = X_DC if in_seat else X_DN
        np.testing.assert_allclose(found.X_WB.as_array(), expected.as_array(), atol=1e-3)


@pytest.mark.parametrize(
    ("grade", "x_m", "in_seat"),
    [("rough", 0.0071, True), ("rough", -0.0071, True), ("perfect", 0.0071, False), ("rough", 0.020, False)],
)
def test_a_camera_that_strains_what_it_shows_moves_a_neighbour_beside_its_seat(
    grade: str, x_m: float, in_seat: bool, scene: Scene
) -> None:
    """A focal length that is 2 % off shows two units that are 0.2 m apart 4 mm too far from each other.

    A docked unit of the grade rough saw its neighbour like that in its seat. The monitor took the neighbour
    to be nearer than it was, and left the unit no room for its tug test, and later none to leave its port.
    """
    told = Scene.model_validate(scene.model_dump() | {"as_built": grade})
    joints, X_DN = [DockStep(unit="c", to="b.left")], X_DC @ SE2(x_m, 0.0105, np.radians(-5.57))
    neighbours = CloseNeighbours(told, ClearanceModel.from_scene(told), told.docks[0], joints, 0.03, 3.0)
    places = {"a": SE2(), "b": SE2(), "c": scene.geometry("b").dock_frame("rear") @ X_DN}
    a, b, c = (GlobalPose(n, 0, X, ROUGH) for n, X in places.items())
    sight = PoseEstimate(0, SE2(-0.5, 0.01, 0.02), SURE, 0)
    (found,) = neighbours.in_dock_frame(ArenaEstimate(0, a, b, (c,), (), 0), sight).others
    expected = X_DC if in_seat else X_DN
    np.testing.assert_allclose(found.X_WB.as_array(), expected.as_array(), atol=1e-3)


@pytest.mark.parametrize("at_first", [(), (DockStep(unit="c", to="b.left"),)])
def test_neighbours_are_those_of_the_docks_that_were_told_last(
    scene: Scene, at_first: tuple[DockStep, ...]
) -> None:
    """27 mm beside unit c a unit that docks drives on only if it knows that c is locked to its target."""
    front, X_WD = float(scene.geometry("a").footprint[:, 0].max()), scene.geometry("b").dock_frame("rear")
    places = {"a": X_WD @ SE2(-0.027 - front, 0.2, 0.0), "b": SE2(), "c": X_WD @ X_DC}
    a, b, c = (GlobalPose(name, 0, X, SURE) for name, X in places.items())
    arena = ArenaEstimate(0, a, b, (c,), (), 0)
    monitor = CollisionMonitor(scene, "a", scene.docks[0], at_first)

    def passes() -> bool:
        return monitor.limit(Twist(0.05), arena, 0, docking=True).state is MonitorState.FREE

    assert passes() is bool(at_first)
    for joints in ((), (("c.front", "b.left"),), (("c.front", "b.left"),), (("c.front", "a.rear"),), ()):
        monitor.brief(Authority("a", 1, 1, 0, 1, 1.0, (), "b.rear", unlock=False, joints=joints))
        assert passes() is (joints == (("c.front", "b.left"),))
    without_target = CollisionMonitor(scene, "a")
    without_target.brief(
        Authority("a", 1, 1, 0, 1, 1.0, (), None, unlock=False, joints=(("c.front", "b.left"),))
    )
    assert without_target.limit(Twist(0.05), arena, 0).state is MonitorState.STOP
