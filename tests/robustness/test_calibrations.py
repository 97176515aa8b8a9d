"""Docking of robots that were built with care, by the drawing: every trial is another robot.

The filter has the errors of calibration in its state, by the tolerances that it is told, and sight refuses a
seat only for what they do not explain. When neither was so, 25 of 40 trials docked and 15 were false aborts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.trial import Trial
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

#: Rates that are claimed for the grade ``careful``: docking, and the first contact within these limits.
DOCKS, MEETS = 0.98, 0.95
CONTACT_LATERAL_M, CONTACT_YAW = 0.0025, math.radians(1.5)
QUICK, FULL = range(3), range(3000, 3040)


@pytest.mark.timeout(600)
def test_careful_robots_meet_the_port_quickly_checked(
    shipped: Callable[..., Scene], claim: Callable[..., Any]
) -> None:
    results = careful_trials(QUICK, shipped)
    check_contacts(results, 2, claim)
    claim("docks, built with care", DOCKS, len(QUICK), 2).check(
        [result.docked for result in results], [result.outcome for result in results]
    )


@pytest.mark.nightly
@pytest.mark.timeout(3600)
def test_careful_robots_meet_the_port_and_dock(
    shipped: Callable[..., Scene], claim: Callable[..., Any]
) -> None:
    results = careful_trials(FULL, shipped)
    check_contacts(results, 34, claim)
    claim("docks, built with care", DOCKS, len(FULL), 37).check(
        [result.docked for result in results], [result.outcome for result in results]
    )


def careful_trials(seeds: range, shipped: Callable[..., Scene]) -> list[TrialResult]:
    scene = shipped("close_range", {"as_built": "careful"})
    return [Trial(scene, seed).run() for seed in seeds]


def check_contacts(results: list[TrialResult], needed: int, claim: Callable[..., Any]) -> None:
    outcomes = [result.outcome for result in results]
    assert not {Outcome.COLLISION, Outcome.CLEARANCE_VIOLATED, Outcome.FALSE_DOCK} & set(outcomes), outcomes
    contacts = [result.steps[0].attempts[0].contact for result in results]
    claim("meets the port to 2.5 mm and 1.5 deg, built with care", MEETS, len(results), needed).check(
        [
            c is not None and abs(c.lateral_m) <= CONTACT_LATERAL_M and abs(c.yaw_rad) <= CONTACT_YAW
            for c in contacts
        ],
        contacts,
    )


def test_the_errors_are_real(shipped: Callable[..., Scene]) -> None:
    """Every trial is another robot; otherwise the tests above would prove nothing."""
    scene = shipped("close_range", {"as_built": "careful"})
    yaws = {draw_as_built(scene, seed).errors["unit/a/onboard/yaw_deg"] for seed in QUICK}
    assert len(yaws) == len(QUICK)
    assert all(yaw != 0.0 for yaw in yaws)
