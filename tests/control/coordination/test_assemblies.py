"""Units that are docked to each other have one pose together, by sight and by their docks."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from msrr_control.coordination.assemblies import locate
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.bodies import Body
from msrr_control.tracks.route_request import RouteRequest, Standing
from msrr_control.tracks.track import standing
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import GlobalPose
from msrr_scenes.messages.coordination import UnitState

DOCKS = {"b": ("a", "left"), "c": ("b", "rear"), "d": ("a", "rear"), "e": ("d", "rear")}

#: Errors of sight as with robots of the grade rough.
SIGMA = np.array([0.008, 0.008, math.radians(1.5)])


def _poses(body: Body, X_WA: SE2) -> dict[str, SE2]:
    poses = {"a": X_WA}
    for name, (holder, port) in DOCKS.items():
        poses[name] = body.docked(poses[holder], port)
    return poses


def _seen(poses: Mapping[str, SE2], sigma: Array = SIGMA) -> dict[str, UnitRecord]:
    """Return docked units of which sight shows these poses."""
    units = {}
    for name, X_WU in poses.items():
        units[name] = UnitRecord(name, state=UnitState.DOCKED, holder=DOCKS.get(name))
        units[name].observe(GlobalPose(name, 1, X_WU, np.diag(sigma**2)), 1)
    return units


def _noisy(poses: Mapping[str, SE2], rng: np.random.Generator) -> dict[str, SE2]:
    errors = {name: rng.normal(0.0, SIGMA).tolist() for name in poses}
    return {
        name: SE2(X.x + e[0], X.y + e[1], X.yaw + e[2])
        for (name, X), e in zip(poses.items(), errors.values(), strict=True)
    }


def _off(X_WA: SE2, X_WB: SE2) -> Array:
    return np.abs((X_WA.inverse() @ X_WB).as_array())


def test_sights_without_errors_stay_as_they_are(setup: CoordinationSetup) -> None:
    """Also where they are said to have none."""
    body, rng = setup.lanes.body, np.random.default_rng(0)
    for sigma in (SIGMA, 0.0 * SIGMA) * 10:
        poses = _poses(body, SE2(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-math.pi, math.pi)))
        units = _seen(poses, sigma)
        locate(units, body)
        for name, X_WU in poses.items():
            assert _off(units[name].pose, X_WU).max() < 1e-12


def test_docked_units_stand_as_their_docks_say_and_in_the_middle_of_what_is_seen(
    setup: CoordinationSetup,
) -> None:
    """The mean place is that of all sights, and neither the order of the units nor the frame W matters."""
    body, rng = setup.lanes.body, np.random.default_rng(1)
    T = SE2(0.4, -1.3, 2.0)
    for _ in range(20):
        true = _poses(body, SE2(0.3, -0.2, rng.uniform(-math.pi, math.pi)))
        seen = _noisy(true, rng)
        units, backwards = _seen(seen), _seen(dict(reversed(seen.items())))
        moved = _seen({name: T @ X for name, X in seen.items()})
        for those in (units, backwards, moved):
            locate(those, body)
        for name, (holder, port) in DOCKS.items():
            assert _off(units[name].pose, body.docked(units[holder].pose, port)).max() < 1e-12
        mean = [
            np.mean([X.translation for X in poses], axis=0)
            for poses in (seen.values(), (unit.pose for unit in units.values()))
        ]
        np.testing.assert_allclose(mean[0], mean[1], atol=1e-6)
        for name, unit in units.items():
            assert _off(unit.pose, backwards[name].pose).max() < 1e-6
            assert _off(T @ unit.pose, moved[name].pose).max() < 1e-6


def test_an_assembly_is_known_better_than_any_unit_that_is_seen(setup: CoordinationSetup) -> None:
    """With five equal sights its middle is off by 1/sqrt(5) = 0.45 of one sight.

    Of 300 draws in two directions the ratio has a standard deviation of 0.45 / sqrt(1200) = 0.013 from each
    of its two parts: a correct one is outside of these bounds once in a million seeds.
    """
    body, rng = setup.lanes.body, np.random.default_rng(2)
    true = _poses(body, SE2(0.3, -0.2, 0.7))
    middle = np.mean([X.translation for X in true.values()], axis=0)
    fitted, single, yaws = [], [], []
    for _ in range(300):
        units = _seen(_noisy(true, rng))
        single += [units["a"].pose.translation - true["a"].translation]
        locate(units, body)
        fitted += [np.mean([unit.pose.translation for unit in units.values()], axis=0) - middle]
        yaws += [wrap_angle(units["a"].pose.yaw - true["a"].yaw)]
    assert 0.37 < np.std(fitted) / np.std(single) < 0.53
    assert np.std(yaws) < 0.53 * SIGMA[2]  # places far apart tell the heading as well


def test_a_unit_that_is_hidden_is_where_its_dock_puts_it(setup: CoordinationSetup) -> None:
    """It has not been seen since it came there; a sight that is hardly known moves nobody either."""
    body = setup.lanes.body
    true = _poses(body, SE2(0.3, -0.2, 0.7))
    units = _seen(true)
    units["c"].sight, units["c"].X_WU = None, true["c"] @ SE2(0.03, -0.02, 0.1)
    blurred = true["e"] @ SE2(0.05, 0.05, 0.1)
    units["e"].observe(GlobalPose("e", 2, blurred, np.eye(3)), 2)
    locate(units, body)
    for name, X_WU in true.items():
        assert _off(units[name].pose, X_WU).max() < 2e-4


def test_what_all_sights_are_off_together_says_nothing_of_which_is_better(setup: CoordinationSetup) -> None:
    """They are all 20 cm unsure, by the same camera; one of them is hardly off against the others."""
    body = setup.lanes.body
    true = _poses(body, SE2(0.3, -0.2, 0.7))
    units, shared = _seen(true), np.diag([0.04, 0.04, 0.0])
    for name, X_WU in true.items():
        sigma = 0.01 * SIGMA if name == "c" else SIGMA
        shown = X_WU if name == "c" else X_WU @ SE2(0.02, 0.0, 0.03)
        units[name].observe(GlobalPose(name, 2, shown, np.diag(sigma**2) + shared, shared), 2)
    locate(units, body)
    assert _off(units["c"].pose, true["c"])[:2].max() < 0.002  # 0.01 if it were as good as the other four


@pytest.mark.parametrize(
    ("name", "off", "state"),
    [
        ("e", SE2(-0.3), UnitState.LOST),
        ("e", SE2(0.0, 0.0, 0.5), UnitState.LOST),
        ("e", SE2(-0.05), UnitState.UNDER_WAY),
        ("d", SE2(-0.05), UnitState.UNDER_WAY),
    ],
)
def test_a_unit_that_is_seen_away_from_its_port_is_not_in_it(
    name: str, off: SE2, state: UnitState, setup: CoordinationSetup
) -> None:
    """It may have left unheard; and one that is under way may be anywhere, with or without its load."""
    body = setup.lanes.body
    poses = _poses(body, SE2(0.3, -0.2, 0.7))
    poses[name] = poses[name] @ off
    units = _seen(poses)
    units[name].state = state
    locate(units, body)
    for other, X_WU in poses.items():
        assert _off(units[other].pose, X_WU).max() < 1e-12


@pytest.mark.parametrize(("off", "follows"), [(0.03, True), (0.3, False)])
def test_a_route_into_a_port_ends_where_the_port_is_by_now(
    setup: CoordinationSetup, off: float, follows: bool
) -> None:
    """If the port stands elsewhere the route does not lead there."""
    body = setup.lanes.body
    units = {name: UnitRecord(name, SE2(k)) for k, name in enumerate(("a", "b", "c"))}
    docks = {"b": ("a", "rear"), "c": ("b", "left")}
    X_WE = {"a": SE2()}
    for order, (name, enters) in enumerate(docks.items()):
        X_WE[name] = body.docked(X_WE[enters[0]], enters[1])
        units[name].set_out(standing(X_WE[name], at_port=True), enters, order, 0)
    units["a"].X_WU = SE2(off)
    locate(units, body)
    X_WB = body.docked(units["a"].pose, "rear") if follows else X_WE["b"]
    assert _off(units["b"].destination, X_WB).max() < 1e-12
    assert _off(units["c"].destination, body.docked(X_WB, "left")).max() < 1e-12


def test_a_neighbour_is_in_nobodys_way_wherever_sight_shows_it(setup: CoordinationSetup) -> None:
    """Sight shows it 12 mm nearer than it stands: no way was found out of the port beside it."""
    body, found = setup.lanes.body, []
    true = {name: X for name, X in _poses(body, SE2()).items() if name in "abd"}
    away = true["d"].translation - true["b"].translation
    for nearer in (0.0, 0.012):
        x, y = (-nearer * away / np.hypot(*away)).tolist()
        shown = true | {"d": SE2(true["d"].x + x, true["d"].y + y, true["d"].yaw)}
        for fits in (False, True):
            units = _seen(shown)
            if fits:
                locate(units, body)
            others = [Standing(unit.name, unit.pose, True) for unit in units.values() if unit.name != "b"]
            request = RouteRequest(units["b"].pose, SE2(-0.3, 1.0, 1.5), others, leaves="a")
            found.append(setup.finder.find(request) is not None)
    assert found == [True, True, False, True]
