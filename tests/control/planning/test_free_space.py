import numpy as np

from msrr_control.planning.free_space import Disc, FreeSpace


def test_a_unit_may_leave_ground_that_it_stands_on_but_not_go_deeper() -> None:
    ground = FreeSpace((-1.0, 1.0, -1.0, 1.0), (Disc("d", 0.0, 0.0, 0.5),))
    here = ground.opened_at(0.3, 0.0)
    assert not ground.allows(np.array([[0.3, 0.0]]))
    assert here.allows(np.array([[0.3, 0.0], [0.9, 0.0]]))
    assert not here.allows(np.array([[0.2, 0.0]]))
    outside = ground.opened_at(1.2, 0.0)
    assert outside.allows(np.array([[1.2, 0.0]]))
    assert not outside.allows(np.array([[1.3, 0.0]]))
