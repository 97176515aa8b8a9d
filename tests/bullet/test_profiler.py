"""The profiler: exclusive times of nested stages."""

import time

import pytest

from msrr_bullet.profiler import NullProfiler, StageProfiler


class FakeTime:
    def __init__(self) -> None:
        self.now = 1_000

    def __call__(self) -> int:
        return self.now


def test_an_inner_stage_pauses_the_outer_one() -> None:
    now = FakeTime()
    profiler = StageProfiler(now)
    assert profiler.span_ns == 0
    now.now += 1_000_000
    with profiler("loop"):
        now.now += 5
        with profiler("physics"):
            now.now += 70
            with profiler("render"):
                now.now += 300
            now.now += 7
        now.now += 2
    now.now += 1_000_000  # outside of every stage
    assert profiler.spent_ns == {"loop": 7, "physics": 77, "render": 300}
    assert profiler.total_ns == profiler.span_ns == 384
    with profiler("loop"):
        now.now += 1
    assert (profiler.total_ns, profiler.span_ns) == (385, 1_000_385)


def test_a_stage_accumulates_and_may_enter_itself() -> None:
    now = FakeTime()
    profiler = StageProfiler(now)
    for _ in range(3):
        with profiler("detect"):
            now.now += 10
            with profiler("detect"):
                now.now += 1
    assert profiler.spent_ns == {"detect": 33}


def test_an_exception_ends_its_stages() -> None:
    now = FakeTime()
    profiler = StageProfiler(now)

    def fail() -> None:
        with profiler("loop"), profiler("physics"):
            now.now += 4
            raise ValueError("x")

    with pytest.raises(ValueError, match="x"):
        fail()
    with profiler("loop"):
        now.now += 3
    assert profiler.spent_ns == {"loop": 3, "physics": 4}


def test_the_sum_of_the_stages_is_the_time_under_the_outermost() -> None:
    profiler = StageProfiler()
    start = time.perf_counter_ns()
    with profiler("loop"):
        for _ in range(2_000):
            with profiler("a"):
                pass
            with profiler("b"), profiler("c"):
                pass
    elapsed = time.perf_counter_ns() - start
    assert 0 <= elapsed - profiler.total_ns < 1_000_000  # the overhead around the outermost `with`


def test_the_null_profiler_accepts_the_calls_of_a_profiler() -> None:
    profiler = NullProfiler()
    with profiler("loop"), profiler("physics"):
        pass
