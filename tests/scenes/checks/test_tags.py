"""Checks of the tags of a port against each other."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pytest

from msrr_scenes.checks.tags import _overlap
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.tag_families import FAMILIES

LEFT, RIGHT = "port_rear_marker_left", "port_rear_marker_right"


def tags(middle_m: float, size_m: float = 0.06, **more: str) -> Mapping[str, str]:
    """Both tags of unit b at that distance from the middle of its board."""
    places = {f"units.b.frames.{slot}.x_m": f"{x}" for slot, x in ((LEFT, -middle_m), (RIGHT, middle_m))}
    sizes = {f"units.b.tag_sizes_m.{slot}": f"{size_m}" for slot in (LEFT, RIGHT)}
    edges = {"los.half_width_m": f"{middle_m + 0.5 * size_m}"}
    return {**places, **sizes, **edges, **more}


@pytest.mark.parametrize(("middle_m", "overlap"), [(0.03, 7.5), (0.01, 47.5), (0.0, 67.5)])
def test_tags_that_cover_each_other_are_named_with_how_far(middle_m: float, overlap: float) -> None:
    """A square of 60 mm and a print of 75 mm reach 67.5 mm from middle to middle."""
    with pytest.raises(SceneError) as caught:
        load_scene("round_robots", tags(middle_m))
    says = f"units.b.frames.{RIGHT}: round.urdf: tags {LEFT} and {RIGHT} cover each other by {overlap:.1f} mm"
    assert says in str(caught.value)


def test_a_mistake_in_a_description_of_many_units_is_told_once() -> None:
    """It was told for each of them: 24 lines for eight units of the same URDF."""
    with pytest.raises(SceneError) as caught:
        load_scene("assemble_cross", {"tags.side_m": "0.058"})
    lines = str(caught.value).splitlines()
    assert len(lines) == 3, lines  # its three ports
    assert all("units.a.urdf and 7 more units: unit.urdf: tags " in line for line in lines), lines
    # All ports are drawn alike, whichever way they face.
    assert len({line.partition("cover each other by ")[2].partition(", seen")[0] for line in lines}) == 1, (
        lines
    )


def test_margins_may_share_their_white() -> None:
    load_scene("round_robots", tags(0.0338))
    with pytest.raises(SceneError, match="cover each other"):
        load_scene("round_robots", tags(0.0336))


def test_families_with_bits_around_the_square_need_all_of_their_print() -> None:
    """The square of 60 mm alone would be free of the other print at 49 mm from the middle."""
    family = FAMILIES["tagStandard52h13"]
    width = family.plate_ratio * 0.06
    assert 0.5 * (width + 0.06) < 2.0 * 0.049 < width
    with pytest.raises(SceneError, match=f"tags {LEFT} and {RIGHT} cover each other by 2.0 mm"):
        load_scene("round_robots", tags(0.049, **{"tags.family": family.name}))


def test_a_tag_may_be_in_the_empty_middle_of_another_one() -> None:
    load_scene("round_robots", tags(0.03, **{"tags.family": "tagCustom48h12"}))


def test_the_message_tells_how_far_to_move() -> None:
    with pytest.raises(SceneError) as caught:
        load_scene("round_robots", tags(0.02))
    found = re.search(r"by (\S+) mm", str(caught.value))
    assert found
    load_scene("round_robots", tags(0.02 + 0.5e-3 * float(found[1])))


def test_the_overlap_is_the_least_way_by_which_two_polygons_part() -> None:
    """Turned squares, in any order: of a square on its corner it is the way to the side of the other one."""
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    turned = square @ np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)
    for x in (0.0, 1.0, 2.0, 3.0):
        expected = 1.0 + np.sqrt(2.0) - x
        other = turned + np.array([x, 0.0])
        assert _overlap(square, other) == pytest.approx(expected)
        assert _overlap(other, square) == pytest.approx(expected)
        assert _overlap(square[::-1], other) == pytest.approx(expected)


def test_the_overlap_of_slanted_polygons_is_across_the_sides_by_which_they_part_first() -> None:
    """A tag that is turned against its port is no square, seen from in front."""
    slanted = np.array([[0.0, 0.0], [4.0, 0.0], [5.0, 1.0], [1.0, 1.0]])
    for off, expected in (
        ([0.0, 0.0], 1.0),
        ([0.0, 0.4], 0.6),
        ([3.5, 0.0], np.sqrt(0.125)),
        ([0, 1.5], -0.5),
    ):
        other = slanted + np.array(off)
        assert _overlap(slanted, other) == pytest.approx(expected)
        assert _overlap(other, slanted) == pytest.approx(expected)
    triangle = np.array([[1.0, 0.5], [3.0, 0.5], [1.0, 2.5]])
    assert _overlap(slanted, triangle) == pytest.approx(_overlap(triangle, slanted)) == pytest.approx(0.5)
