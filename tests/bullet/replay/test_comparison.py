"""The comparison of a log with a replay: equal bits, differences, and the limit on their number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.log import read_log
from msrr_bullet.log.reader import LogRecord
from msrr_bullet.replay.comparison import MAX_MISMATCHES, Diverged, Mismatch, ReplayComparison, ReplayReport
from msrr_scenes.messages import Action, Twist


@pytest.fixture(scope="module")
def record_of_action(recorded_run: Path) -> LogRecord:
    return next(r for r in read_log(recorded_run).records() if r.kind is Action)


def test_only_equal_bits_are_equal(record_of_action: LogRecord) -> None:
    comparison, logged = ReplayComparison(), record_of_action.message
    assert comparison.compare("command", record_of_action, logged)
    assert comparison.mismatches == []
    next_float = float(np.nextafter(logged.twist.v, 2.0))
    other = Action(logged.stamp_ns, logged.phase, 1, Twist(next_float, logged.twist.w))
    assert not comparison.compare("command", record_of_action, other)
    assert not comparison.compare("command", record_of_action, None)
    first, second = comparison.mismatches
    assert (first.what, first.sequence) == ("command", record_of_action.sequence)
    assert first.time_s == pytest.approx(1e-9 * record_of_action.stamp_ns)
    assert first.logged == record_of_action.data.decode()
    assert repr(next_float) in (first.replayed or "")
    assert (second.logged, second.replayed) == (first.logged, None)
    when = f"{1e-9 * logged.stamp_ns:.3f} s, command: "
    assert f"twist.v logged {logged.twist.v}, replayed {next_float}" in str(first)
    assert str(second) == f"{when}logged {second.logged}, replayed None"


def test_the_comparison_ends_after_a_number_of_differences(record_of_action: LogRecord) -> None:
    comparison = ReplayComparison()
    for _ in range(MAX_MISMATCHES - 1):
        comparison.add("window", record_of_action, None, "x")
    with pytest.raises(Diverged):
        comparison.add("window", record_of_action, None, "x")
    assert len(comparison.mismatches) == MAX_MISMATCHES


def test_a_report_is_identical_only_if_something_was_compared_and_nothing_differs() -> None:
    def report(commands: int, *mismatches: Mismatch) -> ReplayReport:
        counts = dict.fromkeys(("steps", "sensor_messages", "estimates", "windows", "detections"), 1)
        return ReplayReport(
            log=Path("x"),
            complete=True,
            judged=True,
            end_s=1.0,
            commands=commands,
            mismatches=mismatches,
            **counts,
        )

    difference = Mismatch(what="los", sequence=3, time_s=0.1, logged=None, replayed="{}")
    assert report(5).identical
    assert not report(0).identical
    assert not report(5, difference).identical
    again = ReplayReport.model_validate_json(report(5, difference).model_dump_json())
    assert again == report(5, difference)
