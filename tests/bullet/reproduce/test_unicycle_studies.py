"""The studies on unicycles: a table for each phase and setting, panels, ablations and maps."""

from msrr_bullet.studies.ablations import VARIANTS
from msrr_bullet.studies.model import Reproduction


def test_every_study_is_in_the_results(unicycle_results: Reproduction) -> None:
    tables = [(t.phase, t.setting, [r.label for r in t.rows]) for t in unicycle_results.tables]
    close = ["C2", "C1", "CBF"]
    assert tables == [
        ("long", "standard", ["C1"]),
        ("long", "hard", ["C1"]),
        ("close", "standard", close),
        ("close", "hard", close),
    ]
    assert {p.phase: list(p.series) for p in unicycle_results.panels} == {"long": ["C1"], "close": close}
    for ablations in unicycle_results.ablations:
        (table,) = ablations.tables
        assert table.phase == ablations.phase
        assert [r.label for r in table.rows] == list(VARIANTS[ablations.phase])
    assert [(m.compensated, len(m.gains)) for m in unicycle_results.maps] == [(False, 4), (True, 2)]
    assert unicycle_results.seeds == {"unicycle": (0, 3)}
