"""The ranking of the docking laws: its order, what differs from the default, and the default it names."""

import numpy as np

from msrr_bullet.reproduce.report.ranking import default_controller_text, ranking, ranking_text
from msrr_bullet.studies.model import Measured, Reproduction, Row, Table, rates_of

CONE, TIME, LATERAL, BESIDE = 3, 4, 5, 7


def row(
    label: str,
    docked: int = 20,
    in_cone: int = 20,
    lateral_m: float = 0.001,
    time_s: float = 7.0,
    trials: int = 20,
) -> Row:
    """A row of the close phase, each trial with the same values."""
    return Row(
        controller=label.lower(),
        label=label,
        trials=trials,
        **rates_of(
            success=np.arange(trials) < docked,
            in_view=np.arange(trials) < docked,
            in_cone=np.arange(trials) < in_cone,
        ),
        measures={
            "contact": Measured.of([time_s] * trials),
            "lateral": Measured.of([lateral_m] * trials),
            "yaw": Measured.of([0.001] * trials),
        },
    )


def table(setting: str, *rows: Row, plant: str = "unicycle") -> Table:
    return Table(phase="close", plant=plant, setting=setting, description=f"here, {setting}", rows=rows)


def results(*tables: Table) -> Reproduction:
    return Reproduction(versions={}, seeds={}, tables=tables)


def test_the_worst_setting_of_a_law_counts() -> None:
    """Best with compensation, and the target lost without it: behind one that is good in both."""
    found = results(
        table("wide", row("CBF", lateral_m=0.0001), row("C1", in_cone=14), row("GRACEFUL")),
        table("wide, uncompensated", row("CBF", in_cone=10), row("C1", in_cone=12), row("GRACEFUL")),
        table("hard", row("C1"), row("CBF", docked=0), row("GRACEFUL", docked=0)),  # not of the ranking
    )
    assert [r[:2] for r in ranking(found)] == [
        (f"unicycle, {setting}", law)
        for setting in ("wide", "wide, uncompensated")
        for law in ("GRACEFUL", "C1", "CBF")
    ]
    text = default_controller_text(found)
    assert "GRACEFUL is the best" in text
    assert "The default is worse." in text
    assert "here, wide; unicycle, 20 trials: here, wide, uncompensated" in text
    assert "50.0 % in the cone" in text


def test_of_equal_rates_the_one_of_fewer_trials_is_told() -> None:
    """20 of 20 trials make at least 83.9 %, 10 of 10 at least 72.2 % (Wilson)."""
    few = row("CBF", docked=10, in_cone=10, trials=10)
    text = default_controller_text(results(table("wide", row("CBF")), table("wide, uncompensated", few)))
    assert "100.0 % (72.2 .. 100.0) docked" in text
    assert "83.9" not in text


def test_what_differs_from_the_default_beyond_chance_is_said() -> None:
    """Six trials lost and none won have p = 0.03, five 0.06; equal values have an interval of no width."""
    rows = (
        row("CBF", 40, 40, trials=40),
        row("C1", 40, 34, lateral_m=0.003, time_s=6.5, trials=40),
        row("LINEAR", 40, 35, trials=40),
        row("C1, tuned", docked=0, trials=40),
    )
    found = {r[1]: r for r in ranking(results(table("hard starts", *rows, plant="bullet")))}
    assert set(found) == {"CBF", "C1", "LINEAR"}
    assert found["CBF"][BESIDE] == "-"
    assert found["C1"][BESIDE] == "cone: 6 lost, 0 won; time -0.5 .. -0.5 s; lateral +2 .. +2 mm"
    assert found["LINEAR"][BESIDE] == "nothing beyond chance"
    assert found["C1"][CONE].startswith("85.0 % (")
    assert (found["C1"][TIME], found["C1"][LATERAL]) == ("6.5 / 6.5", "3 / 3")


def test_too_few_trials_for_a_percentile_are_said() -> None:
    """The largest of 20 errors alone lies beyond the 95th percentile, whatever the laws are."""
    found = ranking(results(table("hard", row("CBF"), row("C1", in_cone=14, lateral_m=0.003))))
    beside = {r[1]: r[BESIDE] for r in found}
    assert beside["C1"] == "cone: 6 lost, 0 won; too few trials: time, lateral, yaw"


def test_one_trial_is_no_trials() -> None:
    text = default_controller_text(results(table("hard", row("CBF", 1, 1, trials=1))))
    assert "(unicycle, 1 trial: here, hard)" in text


def test_the_best_controller_is_named_with_those_that_cannot_be_told_from_it() -> None:
    rows = (row("C1", in_cone=4), row("CBF", lateral_m=0.002), row("GRACEFUL"))
    text = default_controller_text(results(table("hard", *rows)))
    assert "GRACEFUL is the best" in text
    assert (
        "The default cannot be told from it. The rates of GRACEFUL cannot be told from those of CBF (" in text
    )
    assert "Worse are C1 (100.0 % docked, 100.0 % in view, 20.0 % in the cone, 1 mm)." in text


def test_a_law_is_worse_by_the_level_of_all_its_rates_together() -> None:
    """Six trials lost and none won have p = 0.03 and nine 0.004, and each law has three rates."""
    rows = (row("CBF"), row("C1", in_cone=14), row("LINEAR", in_cone=11))
    text = default_controller_text(results(table("hard", *rows)))
    assert "The rates of CBF cannot be told from those of C1 (" in text
    assert "Worse are LINEAR (" in text


def test_without_tables_nothing_is_ranked() -> None:
    assert default_controller_text(results()) == ranking_text(results()) == ""
