import itertools
import math

import numpy as np
import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.collision.locked_group import NEIGHBOUR_MARGIN_M, locked_group, neighbour_limits, seat_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.scene import Scene


def shape(*steps: tuple[str, str]) -> Scene:
    names = sorted({unit for unit, _ in steps} | {to.partition(".")[0] for _, to in steps})
    return Scene.model_validate(
        {
            "name": "shape",
            "units": {n: {"number": i, "pose": {"x_m": i}} for i, n in enumerate(names)},
            "plan": [{"unit": unit, "to": to} for unit, to in steps],
        }
    )


CROSS = shape(("a", "b.rear"), ("c", "b.left"), ("d", "b.right"))


def test_a_seated_unit_faces_the_target_with_its_port_on_the_port() -> None:
    scene, step = CROSS, CROSS.plan[1]
    X_TP = seat_pose(scene, step) @ scene.geometry("c").port("front")
    X_TD = scene.geometry("b").dock_frame("left")
    assert (X_TP.x, X_TP.y) == pytest.approx((X_TD.x, X_TD.y))
    assert math.remainder(X_TP.yaw - X_TD.yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)


def test_a_group_is_the_same_seen_from_each_of_its_units() -> None:
    """X_UV of one unit equals the product of the way over any other."""
    steps = CROSS.plan
    groups = {unit: locked_group(CROSS, steps, unit) for unit in CROSS.units}
    for u, v, w in itertools.permutations(CROSS.units, 3):
        direct, over = groups[u][v], groups[u][w] @ groups[w][v]
        np.testing.assert_allclose(direct.as_array()[:2], over.as_array()[:2], atol=1e-12)
        assert math.remainder(direct.yaw - over.yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)
    assert locked_group(CROSS, steps[:1], "d") == {"d": SE2()}


def test_corner_neighbours_of_the_shipped_unit_are_seated_28_mm_apart() -> None:
    model = ClearanceModel.from_scene(CROSS)
    limits = neighbour_limits(CROSS, model, CROSS.plan[:1], CROSS.plan[1])
    assert limits == {"a": pytest.approx(0.028 - NEIGHBOUR_MARGIN_M, abs=0.001)}
    both = neighbour_limits(CROSS, model, CROSS.plan[:2], CROSS.plan[2])
    assert both["a"] == pytest.approx(limits["a"])
    assert both["c"] > 0.15, "c stands on the other side of the target"


def test_whoever_is_not_locked_to_the_target_is_no_neighbour() -> None:
    scene = shape(("a", "b.rear"), ("c", "d.rear"))
    assert neighbour_limits(scene, ClearanceModel.from_scene(scene), scene.plan[:1], scene.plan[1]) == {}
