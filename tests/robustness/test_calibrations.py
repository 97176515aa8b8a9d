"""Docking of robots that were built with care, by the drawing: every trial is another robot.

The estimator does not yet use the tolerances that it is told, so the claims are modest: systematic errors go
one to one into the contact, and a dock that is believed not to be one counts as a failure.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from msrr_bullet.trial.trial import Trial
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

#: Rates that are claimed for the grade ``careful``.
DOCKS, MEETS = 0.8, 0.95
CONTACT_LATERAL_M, CONTACT_YAW = 0.006, math.radians(3.0)
QUICK, FULL = range(3), range(2000, 2040)


@pytest.mark.timeout(600)
def test_careful_robots_dock_quickly_checked(
    shipped: Callable[..., Scene], claim: Callable[..., Any]
) -> None:
    check(QUICK, 1, 2, shipped, claim)


@pytest.mark.nightly
@pytest.mark.timeout(3600)
def test_careful_robots_dock(shipped: Callable[..., Scene], claim: Callable[..., Any]) -> None:
    check(FULL, 26, 34, shipped, claim)


def check(
    seeds: range, docked: int, met: int, shipped: Callable[..., Scene], claim: Callable[..., Any]
) -> None:
    scene, trials = shipped("close_range", {"as_built": "careful"}), len(seeds)
    results = [Trial(scene, seed).run() for seed in seeds]
    outcomes = [result.outcome for result in results]
    assert not {Outcome.COLLISION, Outcome.CLEARANCE_VIOLATED, Outcome.FALSE_DOCK} & set(outcomes), outcomes
    claim("docks, built with care", DOCKS, trials, docked).check([r.docked for r in results], outcomes)
    contacts = [result.steps[0].contact for result in results]
    claim("meets the port to 6 mm and 3 deg, built with care", MEETS, trials, met).check(
        [c is not None and c.lateral_m <= CONTACT_LATERAL_M and c.yaw_rad <= CONTACT_YAW for c in contacts],
        contacts,
    )


def test_the_errors_are_real(shipped: Callable[..., Scene]) -> None:
    """Every trial is another robot; otherwise the tests above would prove nothing."""
    scene = shipped("close_range", {"as_built": "careful"})
    yaws = {draw_as_built(scene, seed).errors["unit/a/onboard/yaw_deg"] for seed in QUICK}
    assert len(yaws) == len(QUICK)
    assert all(yaw != 0.0 for yaw in yaws)
