"""The figure of the ablations: what its note says of the whiskers."""

import numpy as np
import pytest

from msrr_bullet.reproduce.report.ablation_plot import whisker_note
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import Ablations, Measured, Row, Table, rates_of


@pytest.mark.parametrize(("trials", "unbounded"), [(71, True), (72, False)])
def test_whiskers_without_an_upper_bound_are_told(trials: int, unbounded: bool) -> None:
    """The largest of 71 values is below the 95th percentile once in 38 samples, 0.95^71 = 2.6 %."""
    row = Row(
        controller="c1",
        label="C1",
        trials=trials,
        **rates_of(success=np.ones(trials, dtype=bool)),
        measures={"final": Measured.of([0.001] * trials)},
    )
    table = Table(phase="close", plant="unicycle", setting="here", description="", rows=(row,))
    note = whisker_note(Ablations(phase="close", tables=(table,)), [measure("final")])
    assert ("no upper bound" in note) == unbounded
