"""The progress of a long run: trials are counted, and the time left is estimated by group."""

import pytest

from msrr_bullet.reproduce.progress import Forecast, TrialCounter


def test_what_is_left_is_estimated_by_group() -> None:
    now = [0.0]
    forecast = Forecast({"long": (4, 3.0), "short": (10, 1.0)}, clock=lambda: now[0])
    assert str(forecast) == "0 of all 14"
    for _ in range(2):
        forecast.count("long", stored=True)
    now[0] = 60.0
    forecast.count("long", stored=False)
    # One of the long ones and ten that take a third of it.
    assert forecast.seconds_left == pytest.approx(60.0 + 10 * 20.0)
    assert str(forecast) == "3 of all 14, about 4 min left"
    now[0] = 70.0
    forecast.count("short", stored=False)
    assert forecast.seconds_left == pytest.approx(60.0 + 9 * 10.0)


def test_a_counter_reports_the_experiment_and_the_whole_run() -> None:
    lines: list[str] = []
    forecast = Forecast({"first": (3, 1.0), "second": (2, 1.0)}, clock=lambda: 0.0)
    counter = TrialCounter(lines.append, forecast, "first", "C1", 3)
    counter.report()
    counter.count(None, stored=True)
    counter.count(None, stored=False)
    assert lines == [
        "first, C1: 0 of 3 (0 of all 5)",
        "first, C1: 1 of 3 (1 of all 5)",
        "first, C1: 2 of 3 (2 of all 5, about 0 s left)",
    ]
