"""The findings in words: requirements, and lag behind the desired point."""

import math

import numpy as np

from msrr_bullet.reproduce.report.findings import lag_text, requirements
from msrr_bullet.studies.model import Measured, Reproduction, Row, Table, rates_of
from tests.bullet.reproduce.report.conftest import LONG


def row(label: str, docked: int, in_view: int, lateral_m: float, settling: float = 1.0) -> Row:
    """A row of 20 trials of the close phase."""
    values = {"settling": settling, "final": 0.001, "lateral": lateral_m, "yaw": 0.001}
    return Row(
        controller=label.lower(),
        label=label,
        trials=20,
        **rates_of(
            success=np.arange(20) < docked,
            in_view=np.arange(20) < in_view,
            in_cone=np.arange(20) < in_view,
        ),
        measures={key: Measured.of([value] * 20) for key, value in values.items()},
    )


def results(*rows: Row, setting: str = "standard") -> Reproduction:
    table = Table(phase="close", plant="unicycle", setting=setting, description="here", rows=rows)
    return Reproduction(versions={}, seeds={}, tables=(table,))


def test_a_law_that_never_settles_misses_the_requirement() -> None:
    (settling,) = [r for r in requirements(results(row("C1", 20, 20, 0.001, math.inf))) if "15 mm" in r.text]
    assert settling.text == "C1, unicycle, here: time to stay under 15 mm at most 1.2 / 2 s"
    assert (settling.result, settling.met) == ("never / never s", False)
    few = row("C1", 20, 20, 0.001)
    times = Measured.of([1.0] * 18 + [math.inf] * 2)
    few = few.model_copy(update={"measures": {**few.measures, "settling": times}})
    (settling,) = [r for r in requirements(results(few)) if "15 mm" in r.text]
    assert (settling.result, settling.met) == ("1 / never s", False)


def test_without_tables_no_requirement_is_answered() -> None:
    assert requirements(Reproduction(versions={}, seeds={})) == []


def test_both_distances_are_compared() -> None:
    (text,) = lag_text(Reproduction(versions={}, seeds={}, tables=(LONG,)))
    assert text.endswith(
        "C1: amplitude 0.25 / 0.25 m to the desired point and 0.24 / 0.24 m to the path, "
        "recovery 2.2 / 2.2 s to the desired point and 2.1 / 2.1 s to the path; "
        "C2: amplitude 0.51 / 0.51 m to the desired point and 0.26 / 0.26 m to the path, "
        "recovery 3.5 / 3.5 s to the desired point and 2.3 / 2.3 s to the path."
    )
