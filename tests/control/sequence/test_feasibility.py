"""What a scene tells the phase machine has to be possible."""

from __future__ import annotations

import re
from collections.abc import Mapping

import pytest

from msrr_control.sequence.feasibility import check_sequence
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"cameras.onboard.rate_hz": "1.5"}, r"docking.lost_time_s: .* 1.5 Hz .* 0.707 s old; .* found 0.6"),
        ({"cameras.onboard.latency_ms": "650"}, "docking.lost_time_s: .* come 650 ms late"),
        ({"docking.lost_time_s": "0.08"}, "found 0.08"),
        ({"docking.retreat_m": "0.02"}, "docking.retreat_m: a unit has left b.rear when .* found 0.02"),
        (
            {"docking.verify.time_s": "0.15"},
            r"docking.verify.time_s: 3 pictures .* takes 0.16 s .* found 0.15",
        ),
        (
            {"as_built": "rough", "docking.verify.tug_m": "0.02"},  # 24 deg of wheels of 33 mm are 13.8 mm
            r"docking.verify.tug_m: .* 8 deg .* 33 mm may take up 0.0138 m, .* to 0.0208, .* found 0.02$",
        ),
    ],
)
def test_what_no_unit_can_dock_by_is_refused(changes: Mapping[str, str], said: str) -> None:
    """Units lost a port that every picture showed, unlocked from one in which they were seated, and said that
    they were stuck in one that they had been told not to leave.
    """
    with pytest.raises(SceneError, match=said):
        check_sequence(load_scene("close_range", changes))


@pytest.mark.parametrize(
    ("key", "value", "changes"),
    [
        ("docking.verify.tug_m", "0.001", {"as_built": "rough"}),
        ("docking.verify.tug_m", "0.001", {"as_built": "careful"}),
        ("docking.verify.tug_m", "0.001", {"as_built.drive.backlash_deg": "{sigma: 0.7}"}),
        ("docking.verify.time_s", "0.15", {"cameras.onboard.rate_hz": "23"}),
        ("docking.retreat_m", "0.02", {}),
    ],
)
def test_who_raises_a_value_as_a_message_says_is_not_refused_again(
    key: str, value: str, changes: Mapping[str, str]
) -> None:
    """Rounded down, 0.0207 for a tug of at least 0.02073 m was refused as well."""
    with pytest.raises(SceneError) as refused:
        check_sequence(load_scene("close_range", {**changes, key: value}))
    said = re.search(r"raise it to (\d[\d.]*\d)|takes ([\d.]+) s|when it is ([\d.]+) m", str(refused.value))
    assert said is not None
    least = next(number for number in said.groups() if number)
    check_sequence(load_scene("close_range", {**changes, key: least}))


@pytest.mark.parametrize("scene", ["assemble_line", "reconfigure"])
def test_units_of_a_shape_have_to_leave_their_ports_as_well(scene: str) -> None:
    check_sequence(load_scene(scene))
    with pytest.raises(SceneError, match=r"a unit has left b\.rear when"):
        check_sequence(load_scene(scene, {"docking.retreat_m": "0.02"}))


@pytest.mark.parametrize(("tug_m", "by_sight"), [("0", "true"), ("0.021", "true"), ("0.001", "false")])
def test_a_tug_is_long_enough_or_there_is_none(tug_m: str, by_sight: str) -> None:
    changes = {"docking.verify.tug_m": tug_m, "docking.verify.by_sight": by_sight}
    check_sequence(load_scene("close_range", {"as_built": "rough", **changes}))


def test_a_seat_that_is_not_looked_at_needs_no_pictures() -> None:
    check_sequence(
        load_scene("close_range", {"docking.verify.time_s": "0.01", "docking.verify.by_sight": "false"})
    )
