"""The map over gain and delay has a region in which both laws dock and one in which C1 alone does."""

from msrr_bullet.studies.gain_delay import LAWS, gain_delay_map


def test_the_map_has_both_regions() -> None:
    chart = gain_delay_map(False, range(12), map, gains=(0.8, 6.0), latencies=(0.0, 0.1))
    low_gain = [chart.cells[law][0][0].success for law in LAWS]
    high_gain = [chart.cells[law][1][1].success for law in LAWS]
    assert low_gain == [1.0, 1.0]
    assert high_gain[0] > 0.9 > 0.5 > high_gain[1]
    assert chart.paper_cell == (6.0, 0.1)
