"""Records of clearances."""

from __future__ import annotations

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.log import ClearanceRecord


def test_a_clearance_comes_back_from_its_record() -> None:
    clearance = Clearance(0.25, "a", "b", (0.0, 1.0), (0.25, 1.0))
    record = ClearanceRecord.of(7, clearance)
    assert record.clearance == clearance
    assert record.stamp_ns == 7
    assert ClearanceRecord(7, ("a", "b"), 0.25).clearance is None
