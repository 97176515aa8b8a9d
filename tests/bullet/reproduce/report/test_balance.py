"""What speaks for C1 and against it: every difference in the results is on one of the two sides."""

import pytest

from msrr_bullet.reproduce.report.balance import balances
from msrr_bullet.studies.docking_studies import docking_row
from msrr_bullet.studies.gain_delay import C1, C1_WITHOUT, C2_WITH
from msrr_bullet.studies.labels import C2
from msrr_bullet.studies.model import GainDelayMap, MapCell, Reproduction, Table
from msrr_bullet.studies.settings import WIDE
from msrr_scenes.specs.spec import Choice

GOOD, BAD = MapCell(success=1.0, final_p50_m=0.01), MapCell(success=0.5, final_p50_m=0.04)


@pytest.mark.parametrize("other", ["linear", "cbf"])
def test_what_speaks_against_c1_is_said(other: str) -> None:
    """From wide starts it lets the target out of the cone more often; 100 trials at a fixed seed."""
    rows = tuple(docking_row(Choice(name=n), n.upper(), WIDE, range(100)) for n in ("c1", other))
    table = Table(phase="close", plant="unicycle", setting="wide", description="", rows=rows)
    (balance,) = balances(Reproduction(versions={}, seeds={}, tables=(table,)))
    assert (balance.other, balance.where) == (other.upper(), "unicycle, close phase")
    kept = [row.in_cone.rate for row in rows if row.in_cone is not None]
    text = f"kept in the cone {round(100 * kept[0])} instead of {round(100 * kept[1])} of 100"
    assert kept[0] < kept[1]
    assert any(line.startswith(text) for line in balance.worse)
    assert not any("in the cone" in line for line in balance.better)


@pytest.mark.parametrize("compensated", [False, True])
def test_cells_that_only_another_docks_in_speak_against_c1(compensated: bool) -> None:
    chart = GainDelayMap(
        compensated=compensated,
        gains=(1.0, 11.0),
        latencies=(0.0, 0.1),
        lag=0.05,
        extra_gain=2.0,
        trials=20,
        cells={
            C1: ((GOOD, GOOD), (BAD, BAD)),
            C2: ((GOOD, BAD), (GOOD, BAD)),
            C1_WITHOUT: ((GOOD, GOOD), (GOOD, BAD)),
            C2_WITH: ((GOOD, GOOD), (BAD, BAD)),
        },
        paper_cell=(1.0, 0.0),
    )
    c2, without = balances(Reproduction(versions={}, seeds={}, maps=(chart,)))
    assert (c2.other, without.other) == (C2, C1_WITHOUT)
    assert "with delay" in c2.where if compensated else "without delay" in c2.where
    lost = ["does not dock in 1 of 4 cells in which the other does: k_n = 11 1/s and 50 ms"]
    assert c2.worse == without.worse == lost
    assert c2.better == ["docks in 1 of 4 cells in which the other does not: k_n = 1 1/s and 150 ms"]
    assert without.better == ["docks in 0 of 4 cells in which the other does not"]
