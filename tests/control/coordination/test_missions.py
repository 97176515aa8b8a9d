"""The long run of missions on the kinematic rig: shapes, radios, failures, reconfigurations.

Every mission has to end as it should, so a run of n missions states that the rate of others is 0: it would
pass by chance with odds of at most 5 % if that rate were 3 / n, which is 3 % for 100 missions, 15 % for 20.
"""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Callable
from typing import Any, get_args

import numpy as np
import pytest

from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.shape import Shape, build_pattern
from msrr_control.tracks.route_params import RouteParams
from msrr_control.tracks.route_request import RouteRequest, Standing
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.messages.coordination import MissionState, UnitState
from msrr_scenes.specs.mission import Pattern, RadioSpec

Rig = Any
Starts = Callable[..., dict[str, SE2]]

SEEDS = range(20)

#: Makespan over that of the same mission one by one, paired median of 20 seeds, that is promised.
RATIO: dict[Pattern, float] = {"cross": 0.40, "tee": 0.55, "comb": 0.55, "line": 0.70, "zigzag": 0.70}

LOSS = {"loss": 0.2, "latency_ms": 200}
RADIOS = {
    "loss": RadioSpec.model_validate(LOSS),
    "silence": RadioSpec.model_validate({**LOSS, "silences": [{"from_s": 15, "until_s": 25}]}),
    "bad": RadioSpec.model_validate(
        {"loss": 0.5, "latency_ms": 1000, "jitter_ms": 500, "silences": [{"from_s": 15, "until_s": 25}]}
    ),
}


def _complete(run: Rig, shape: Shape) -> float:
    """Run a mission, which has to be completed; return the time of the last lock [s]."""
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(shape)
    last: float = run.last_lock_s
    return last


@pytest.mark.nightly
@pytest.mark.parametrize("pattern", get_args(Pattern))
@pytest.mark.timeout(3000)
def test_all_shapes_are_built_in_parallel_and_faster_than_one_by_one(
    pattern: Pattern, rig: type[Rig], starts: Starts, record_property: Callable[[str, object], None]
) -> None:
    shape = build_pattern(pattern, 8)
    times, bounds = [], []
    for seed in SEEDS:
        runs = [rig(Mission(shape=shape, one_by_one=one), starts(seed, 8)) for one in (False, True)]
        together, alone = (_complete(run, shape) for run in runs)
        times.append((together, alone))
        bounds.append(runs[0].bound_s() / alone)
        assert runs[0].bound_s() <= together
    ratios = [together / alone for together, alone in times]
    record_property("makespan", statistics.median(together for together, _ in times))
    record_property("ratio", statistics.median(ratios))
    print(f"{pattern}: makespan {statistics.median(t for t, _ in times):.1f} s,", end=" ")
    print(f"over one by one {statistics.median(ratios):.3f}, at most {max(ratios):.3f},", end=" ")
    print(f"where {statistics.median(bounds):.3f} is the least that these routes allow")
    assert statistics.median(ratios) <= RATIO[pattern]


@pytest.mark.nightly
@pytest.mark.parametrize("radio", RADIOS)
@pytest.mark.parametrize("pattern", get_args(Pattern))
@pytest.mark.timeout(3000)
def test_whatever_the_radio_does_all_are_built_and_nobody_touches(
    pattern: Pattern, radio: str, rig: type[Rig], starts: Starts
) -> None:
    shape = build_pattern(pattern, 8)
    times = [
        _complete(rig(Mission(shape=shape), starts(seed, 8), radio=RADIOS[radio], seed=seed), shape)
        for seed in SEEDS
    ]
    print(f"{pattern}, {radio}: makespan {statistics.median(times):.1f} s")


@pytest.mark.nightly
@pytest.mark.parametrize("spare", [True, False])
@pytest.mark.parametrize("pattern", ["cross", "tee"])
@pytest.mark.timeout(3000)
def test_after_a_failure_all_is_built_that_somebody_can_reach(
    pattern: Pattern, spare: bool, rig: type[Rig], starts: Starts
) -> None:
    """A unit seizes on its way. Only a place that its body closes stays empty, and those behind it."""
    shape, count = build_pattern(pattern, 6), 6 + spare
    failed = complete = short = 0
    for seed in range(60):
        rng = np.random.default_rng([seed, 3])
        victim = f"u{rng.integers(count)}"
        dies = {victim: (float(rng.uniform(1.0, 20.0)), False)}
        run = rig(Mission(shape=shape), starts(seed, count), dies=dies)
        status = run.run()
        if run.units[victim].dead_s is None:  # it was docked by then, or never moved
            assert status.state is MissionState.COMPLETE, status.reason
            continue
        failed += 1
        complete += status.state is MissionState.COMPLETE
        assert status.state is MissionState.COMPLETE or victim in status.reason
        if len(status.done) < 5 + spare:
            short += 1
            assert not _is_reachable(run, shape, status.given_up[0]), status.reason
    print(f"{pattern}, spare {spare}: {failed} failed, {complete} complete, {short} with closed lanes")
    assert failed >= 20
    assert complete >= 5 or not spare


def _is_reachable(run: Rig, shape: Shape, name: str) -> bool:
    """Whether a unit that is left can reach a place, past the units that are docked or have failed."""
    setup, place = run.setup, shape.by_name[name]
    units = {unit.task: unit for unit in run.status.units if unit.state is UnitState.DOCKED}
    poses = shape.poses(run.units[units[shape.root.name].unit].X_WU, setup.lanes.body)
    standing = [
        Standing(unit.unit, run.units[unit.unit].X_WU, unit.state is UnitState.DOCKED)
        for unit in run.status.units
        if unit.state in (UnitState.DOCKED, UnitState.FAILED)
    ]
    left = [run.units[unit.unit].X_WU for unit in run.status.units if unit.state is UnitState.IDLE]
    parent = units[place.parent].unit
    return any(
        setup.finder.find(RouteRequest(X_WU, poses[name], standing, dock=True, enters=parent)) is not None
        for X_WU in left
    )


@pytest.mark.nightly
@pytest.mark.timeout(3000)
def test_every_pattern_of_six_becomes_every_other(rig: type[Rig]) -> None:
    wide = CoordinationSetup.of(read_unit(find_urdf("unit.urdf")), RouteParams(), (-3.5, 3.5, -3.5, 3.5))
    ratios = []
    for first, second in itertools.permutations(get_args(Pattern), 2):
        old, new = build_pattern(first, 6), build_pattern(second, 6)
        names = {place.name: f"u{k}" for k, place in enumerate(old.places)}
        holders = {names[p.name]: f"{names[p.parent]}.{p.port}" for p in old.places if p.parent is not None}
        poses = old.poses(SE2(0.4, 0.1, 0.3), wide.lanes.body)
        times = []
        for one in (False, True):
            mission = Mission(shape=new, holders=holders, one_by_one=one)
            run = rig(mission, {names[k]: X for k, X in poses.items()}, setup=wide)
            times.append(_complete(run, new))
        ratios.append(times[0] / times[1])
    print(f"{len(ratios)} reconfigurations: makespan over one by one {statistics.median(ratios):.3f}")
    assert statistics.median(ratios) < 0.9


@pytest.mark.nightly
@pytest.mark.parametrize("pattern", get_args(Pattern))
@pytest.mark.timeout(3000)
def test_noise_of_the_overhead_estimates_is_borne(pattern: Pattern, rig: type[Rig], starts: Starts) -> None:
    """Errors of 3 mm and half a degree, ten times those of the overhead camera."""
    shape = build_pattern(pattern, 6)
    for seed in range(10):
        run = rig(Mission(shape=shape), starts(seed, 6), seed=seed, noise=(0.003, 0.01))
        assert run.run().state is MissionState.COMPLETE, run.status.reason
