"""The map over gain and delay in words."""

from msrr_bullet.reproduce.report.gain_delay_findings import map_text
from msrr_bullet.studies.gain_delay import C1, C1_WITHOUT, C2_WITH
from msrr_bullet.studies.labels import C2
from msrr_bullet.studies.model import GainDelayMap, MapCell


def test_the_text_of_the_map_names_gaps() -> None:
    good, bad = MapCell(success=1.0, final_p50_m=0.01), MapCell(success=0.5, final_p50_m=0.04)
    chart = GainDelayMap(
        compensated=True,
        gains=(1.0, 2.0, 3.0),
        latencies=(0.0, 0.1, 0.2),
        lag=0.05,
        extra_gain=2.0,
        trials=20,
        cells={
            C1: ((good,) * 3,) * 3,
            C2: ((good,) * 3, (good, bad, good), (good, bad, bad)),
            C1_WITHOUT: ((bad,) * 3,) * 3,
            C2_WITH: ((good,) * 3,) * 3,
        },
        paper_cell=(1.0, 0.0),
    )
    text = map_text(chart)
    both = (
        "Both dock at k_n = 1 1/s and 50 to 250 ms; k_n = 2 1/s and 50 ms and 250 ms; k_n = 3 1/s and 50 ms."
    )
    assert both in text
    assert "C1 alone docks at k_n = 2 1/s and 150 ms; k_n = 3 1/s and 150 to 250 ms." in text
    assert (
        "With and without anti-windup, docking: C1 in 9, C2 (our reading) in 6, C1 without anti-windup in 0"
        " and C2 (our reading) with anti-windup in 9." in text
    )
