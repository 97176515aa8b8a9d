"""The map over gain and delay: where both laws dock, where C1 alone does, and what makes the difference."""

import pytest

from msrr_bullet.studies.gain_delay import (
    C1,
    C1_WITHOUT,
    C2_WITH,
    GAINS,
    LATENCIES,
    LAWS,
    PAPER_LIKE,
    gain_delay_map,
)
from msrr_bullet.studies.labels import C2
from msrr_bullet.studies.model import GainDelayMap


@pytest.fixture(scope="module")
def chart() -> GainDelayMap:
    return gain_delay_map(False, range(12), map, gains=(0.8, 6.0), latencies=(0.1,))


def test_the_map_has_both_regions(chart: GainDelayMap) -> None:
    success = {law: [chart.cells[law][i][0].success for i in (0, 1)] for law in LAWS}
    assert success[C1][0] == success[C2][0] == 1.0
    assert success[C1][1] > 0.9 > 0.5 > success[C2][1]
    assert chart.paper_cell == (6.0, 0.1)


def test_anti_windup_makes_the_difference_between_the_two(chart: GainDelayMap) -> None:
    """At high gain and delay C1 without it fails as C2 does, and C2 with it docks as C1 does; 12 trials each
    at a fixed seed: 0 or 1 of 12 against 11 or 12."""
    success = {law: cells[1][0].success for law, cells in chart.cells.items()}
    assert min(success[C1], success[C2_WITH]) > 0.9
    assert max(success[C2], success[C1_WITHOUT]) < 0.3


@pytest.mark.nightly
def test_the_setting_of_fig_6_is_that_of_the_map() -> None:
    chart = gain_delay_map(False, range(40), map, GAINS, LATENCIES)
    assert chart.paper_cell == PAPER_LIKE
