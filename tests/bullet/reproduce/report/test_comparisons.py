"""Two controllers on the same trials: what counts as a difference, and how it is said."""

import math

import numpy as np

from msrr_bullet.reproduce.report.comparisons import compare, largest, untold
from msrr_bullet.studies.model import Measured, Row, Table, rates_of
from msrr_scenes.random_streams import stream
from tests.bullet.reproduce.report.conftest import passing

TRIALS = 200


def row(
    label: str,
    *,
    trials: int = TRIALS,
    lost: range = range(0),
    port: np.ndarray | None = None,
    **measures: object,
) -> Row:
    """A row of trials of the close phase, all docked; those in ``lost`` left the cone."""
    every, kept = np.ones(trials, dtype=bool), np.ones(trials, dtype=bool)
    kept[lost] = False
    values = {"port": np.full(trials, 0.002) if port is None else port, **measures}
    return Row(
        controller="c1",
        label=label,
        trials=trials,
        **rates_of(success=every, in_view=every, in_cone=kept),
        measures={key: Measured.of(v) for key, v in values.items()},
    )


def table(*rows: Row, setting: str = "here") -> Table:
    return Table(phase="close", plant="unicycle", setting=setting, description="", rows=rows)


def test_eight_trials_against_none_are_a_loss() -> None:
    """Their rates' 95 % intervals overlap, 76 % (69.6 .. 81.4) and 80 % (73.9 .. 84.9)."""
    changes = compare(
        [table(row("C1", lost=range(40)), row("without it", lost=range(48)))], "C1", "without it"
    )
    assert largest(changes, -1.0) == [
        "kept in the cone 152 instead of 160 of 200 (here; 8 trials lost, 0 won, p = 0.0078)"
    ]
    assert largest(changes, 1.0) == []


def test_what_trials_share_hides_no_difference() -> None:
    """A millimetre more in every trial, where trials scatter by a hundred millimetres."""
    port = np.abs(stream(1, "test/comparisons").normal(0.0, 0.1, TRIALS))
    changes = compare([table(row("C1", port=port), row("C2", port=port + 0.001))], "C1", "C2")
    (text,) = largest(changes, -1.0)
    assert text.startswith("final error to the port, 95th percentile ")
    assert text.endswith(" mm (here; by +1 .. +1)")


def test_the_setting_with_the_largest_difference_is_named() -> None:
    tables = [table(row("C1"), row("C2", lost=range(n)), setting=f"{n} lost") for n in (8, 40, 0)]
    (text,) = largest(compare(tables, "C1", "C2"), -1.0)
    assert "(40 lost; 40 trials lost" in text
    (other,) = largest(compare(tables, "C2", "C1"), 1.0)
    assert "(40 lost; 0 trials lost, 40 won" in other


def test_trials_are_paired_though_some_lack_a_value() -> None:
    """Every trial differs by 1 mm from itself; without its partner's place a gap would shift all others."""
    port = np.abs(stream(2, "test/comparisons").normal(0.0, 0.1, TRIALS))
    other = port + 0.001
    other[::7] = math.nan
    changes = compare([table(row("C1", port=port), row("C2", port=other))], "C1", "C2")
    (text,) = largest(changes, -1.0)
    assert text.endswith(f" mm (here, {np.isfinite(other).sum()} trials; by +1 .. +1)")


def test_too_few_trials_draw_no_verdict() -> None:
    """Ten trials of which each is 10 m worse: a 95th percentile is told from 40 trials on."""
    few, many = (
        table(row("C1", trials=n), row("C2", trials=n, port=np.full(n, 10.0)), setting=f"{n} trials")
        for n in (39, 40)
    )
    changes = compare([few], "C1", "C2")
    assert largest(changes, 1.0) == largest(changes, -1.0) == []
    assert untold(changes) == ["final error to the port, 95th percentile"]
    assert changes[-1].text.endswith(" instead of 2 mm (39 trials; too few trials)")
    changes = compare([few, many], "C1", "C2")
    assert untold(changes) == []
    (text,) = largest(changes, -1.0)
    assert "(40 trials; by " in text


def test_infinite_times_do_not_differ_from_each_other() -> None:
    never = np.full(TRIALS, math.inf)
    changes = compare([table(row("C1", settling=never), row("C2", settling=never))], "C1", "C2")
    assert all(c.effect == 0.0 for c in changes)


def test_a_law_that_drives_through_the_obstacle_has_no_other_figures() -> None:
    rows = (
        passing("C1", 20, amplitude=0.25, recovery=2.0, clearance=0.04),
        passing("without envelope", 20, clear=False, amplitude=0.01, recovery=0.1, clearance=-0.08),
    )
    through = Table(phase="long", plant="unicycle", setting="standard", description="", rows=rows)
    changes = compare([through], "C1", "without envelope")
    (text,) = [c.text for c in changes]
    assert text.startswith("clear of the obstacle 0 instead of 20 of 20 (standard; 20 trials lost, 0 won")
