"""What a docking unit may come near to besides its target: a unit that is locked to the target's side."""

import numpy as np
import pytest

from msrr_bullet.robot.collision_monitor import CollisionMonitor
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ArenaEstimate, GlobalPose, MonitorState, PoseEstimate, Twist
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

SURE = np.diag([0.0003**2, 0.0003**2, 1e-7])
#: Unit c in its seat at the left port of b, in the dock frame D of the rear port of b.
X_DC = SE2(0.1, 0.2, -np.pi / 2)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.model_validate(
        {
            "name": "corner",
            "plant": "unicycle",
            "units": {name: {"number": i} for i, name in enumerate("abc")},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


def decide(
    scene: Scene, X_DU: SE2, docking: bool = True, X_DC: SE2 = X_DC, by_sight: bool = False
) -> MonitorState:
    """Return the state of the monitor of unit a at a pose, which wants to drive on at 5 cm/s."""
    monitor = CollisionMonitor(scene, "a", scene.docks[0], [DockStep(unit="c", to="b.left")])
    X_WD = scene.geometry("b").dock_frame("rear")
    a, b, c = (GlobalPose(n, 0, X, SURE) for n, X in (("a", X_WD @ X_DU), ("b", SE2()), ("c", X_WD @ X_DC)))
    sight = PoseEstimate(0, X_DU, SURE, 0) if by_sight else None
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
    """Just before the seat a unit that sees the port by itself passes a neighbour whose tag is 14 mm off."""
    seat = SE2(-scene.geometry("a").control_offset("front") - 0.002)
    assert decide(scene, seat, by_sight=by_sight) is MonitorState.FREE
    seen_at = X_DC @ SE2(off_m, -off_m)
    passes = by_sight and known_by_its_lock
    assert (decide(scene, seat, X_DC=seen_at, by_sight=by_sight) is MonitorState.FREE) is passes
