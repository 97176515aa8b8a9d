"""The search for a threshold brackets it, wherever it lies, and asks for few sizes."""

import math
from collections.abc import Callable

from hypothesis import given
from hypothesis import strategies as st

from msrr_bullet.tolerance.threshold_search import RESOLUTION, Bracket, threshold_search


def searched(holds: Callable[[float], bool], first: float, top: float) -> tuple[Bracket, list[float]]:
    search, tried = threshold_search(first, top), []
    size = next(search)
    while True:
        tried.append(size)
        try:
            size = search.send(holds(size))
        except StopIteration as end:
            return end.value, tried


@given(st.floats(1e-3, 1e3), st.floats(1.0, 64.0), st.floats(-8.0, 8.0))
def test_the_bracket_holds_the_threshold(first: float, reach: float, octaves: float) -> None:
    top, threshold = first * reach, first * 2.0**octaves
    bracket, tried = searched(lambda size: size <= threshold, first, top)
    assert max(tried) <= top
    assert len(set(tried)) == len(tried)
    if threshold >= top:
        assert (bracket.holds, bracket.fails) == (top, None)
    elif threshold < first / 16.0:
        assert bracket.holds == 0.0
        assert bracket.fails == min(tried)
    else:
        assert bracket.fails is not None
        assert bracket.holds <= threshold < bracket.fails
        assert bracket.fails <= RESOLUTION * bracket.holds or bracket.holds == 0.0
    assert len(tried) <= 3 + math.ceil(math.log2(math.log(max(reach, 16.0)) / math.log(RESOLUTION)))


def test_a_first_size_beyond_the_top_is_the_top() -> None:
    assert searched(lambda size: True, 3.0, 2.0) == (Bracket(2.0, None), [2.0])
    bracket, tried = searched(lambda size: size <= 0.9, 3.0, 2.0)
    assert tried[0] == 2.0
    assert bracket.fails is not None
    assert bracket.holds <= 0.9 < bracket.fails
