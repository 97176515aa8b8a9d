import time

import pytest

from msrr_bullet.profiler import NullProfiler, StageProfiler


class FakeTime:
    def __init__(self) -> None:
        self.now = 1_000

    def __call__(self) -> int:
        return self.now


def test_an_inner_stage_stops_the_outer_one() -> None:
    now = FakeTime()
    clock = StageProfiler(now)
    assert clock.span_ns == 0
    now.now += 1_000_000
    with clock("loop"):
        now.now += 5
        with clock("physics"):
            now.now += 70
            with clock("render"):
                now.now += 300
            now.now += 7
        now.now += 2
    now.now += 1_000_000  # outside of every stage: nobody's
    assert clock.spent_ns == {"loop": 7, "physics": 77, "render": 300}
    assert clock.total_ns == clock.span_ns == 384
    with clock("loop"):
        now.now += 1
    assert (clock.total_ns, clock.span_ns) == (385, 1_000_385)


def test_a_stage_adds_up_and_may_enter_itself() -> None:
    now = FakeTime()
    clock = StageProfiler(now)
    for _ in range(3):
        with clock("detect"):
            now.now += 10
            with clock("detect"):
                now.now += 1
    assert clock.spent_ns == {"detect": 33}


def test_an_exception_closes_its_stages() -> None:
    now = FakeTime()
    clock = StageProfiler(now)

    def fail() -> None:
        with clock("loop"), clock("physics"):
            now.now += 4
            raise ValueError("x")

    with pytest.raises(ValueError, match="x"):
        fail()
    with clock("loop"):
        now.now += 3
    assert clock.spent_ns == {"loop": 3, "physics": 4}


def test_the_sum_of_the_stages_is_the_time_under_the_outermost() -> None:
    clock = StageProfiler()
    start = time.perf_counter_ns()
    with clock("loop"):
        for _ in range(2_000):
            with clock("a"):
                pass
            with clock("b"), clock("c"):
                pass
    elapsed = time.perf_counter_ns() - start
    assert 0 <= elapsed - clock.total_ns < 1_000_000  # only what lies around the outermost `with`


def test_a_null_clock_takes_the_same_calls() -> None:
    clock = NullProfiler()
    with clock("loop"), clock("physics"):
        pass
