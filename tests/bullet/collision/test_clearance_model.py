"""Clearances of bodies against an exact distance in the plane, and the laws that a distance obeys."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.collision.convex_distance import PartPair
from msrr_bullet.collision.footprint import Part, obstacle_parts, unit_parts
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.loading.load import load_scene
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.bodies import BoxSpec, CylinderSpec
from tests.bullet.collision.conftest import exact_distance, random_polygon, random_pose

#: FCL represents a point by a sphere of a nanometre; a few of those are rounding here [m].
NANO = 2e-8
UNIT = read_unit(find_urdf("unit.urdf"))


def random_body(rng):
    """Draw a box or a cylinder of any height, a unit, a polygon, or a body of several parts."""
    height = float(rng.uniform(0.01, 2.0))
    kind = rng.choice(["box", "cylinder", "unit", "polygon", "compound"])
    if kind == "box":
        length, width = rng.uniform(0.01, 1.0, size=2)
        return obstacle_parts(BoxSpec(shape="box", length_m=length, width_m=width, height_m=height))
    if kind == "cylinder":
        return obstacle_parts(
            CylinderSpec(shape="cylinder", radius_m=rng.uniform(0.01, 0.5), height_m=height)
        )
    if kind == "unit":
        return unit_parts(UNIT)
    if kind == "polygon":
        return (random_polygon(rng),)
    return (
        random_polygon(rng),
        random_polygon(rng),
        Part.disc(*rng.normal(size=2) * 0.1, rng.uniform(0.01, 0.2)),
    )


def exact_clearance(parts_a, X_WA, parts_b, X_WB):
    distances = [
        exact_distance(X_WA.act(p.core), X_WB.act(q.core), p.radius + q.radius)
        for p in parts_a
        for q in parts_b
    ]
    return min(distances, key=lambda entry: entry[0])


def random_pairs(count):
    """Draw pairs at random poses; a third of them is moved to touch, another third to overlap slightly."""
    rng = stream(20260101, "test_clearance/oracle")
    for i in range(count):
        a, b = random_body(rng), random_body(rng)
        X_WA, X_WB = random_pose(rng), random_pose(rng)
        if i % 3:
            distance, vector = exact_clearance(a, X_WA, b, X_WB)
            if distance > 0.0:
                unit = vector / np.linalg.norm(vector)
                move = distance + (0.0 if i % 3 == 1 else float(rng.uniform(0.0, 0.02)))
                X_WB = SE2(X_WB.x - move * unit[0], X_WB.y - move * unit[1], X_WB.yaw)
        yield a, X_WA, b, X_WB


@pytest.fixture(scope="module")
def pairs():
    """Return a thousand pairs."""
    return list(random_pairs(1000))


def measure(a, X_WA, b, X_WB) -> Clearance:
    (only,) = ClearanceModel({"a": a, "b": b}).query({"a": X_WA, "b": X_WB})
    return only


@pytest.mark.parametrize("more", [0, pytest.param(4000, marks=pytest.mark.nightly)])
def test_clearances_of_many_pairs_are_exact(pairs, more):
    """FCL's own boxes of different heights err in one of ten pairs, which a sample of 1000 cannot miss."""
    errors, apart, touching, overlapping = [], 0, 0, 0
    many = list(random_pairs(len(pairs) + more)) if more else pairs
    for a, X_WA, b, X_WB in many:
        expected, _ = exact_clearance(a, X_WA, b, X_WB)
        clearance = measure(a, X_WA, b, X_WB)
        errors.append(abs(clearance.distance - expected))
        apart += expected > 1e-3
        touching += abs(expected) <= 1e-9
        overlapping += expected < -1e-9
        if expected < -1e-9:
            assert clearance.distance <= 0.0
    assert min(apart, touching, overlapping) > len(many) // 8, "the sample covers all three cases"
    assert max(errors) < 1e-6


def test_nearest_points_lie_on_the_bodies_and_span_the_distance(pairs):
    for a, X_WA, b, X_WB in pairs[:600]:
        c = measure(a, X_WA, b, X_WB)
        p, q = np.array([c.point_a]), np.array([c.point_b])
        assert np.linalg.norm(p - q) == pytest.approx(abs(c.distance), abs=NANO)
        for point, parts, X in ((p, a, X_WA), (q, b, X_WB)):
            assert min(part.gap(X.inverse().act(point))[0] for part in parts) < 1e-6


def test_clearance_is_symmetric(pairs):
    for a, X_WA, b, X_WB in pairs[-300:]:
        assert measure(a, X_WA, b, X_WB).distance == pytest.approx(
            measure(b, X_WB, a, X_WA).distance, abs=NANO
        )


def test_clearance_does_not_depend_on_the_world_frame(pairs):
    rng = stream(7, "test_clearance/motions")
    for a, X_WA, b, X_WB in pairs[-300:]:
        X_VW = random_pose(rng, spread=3.0)
        before, after = measure(a, X_WA, b, X_WB), measure(a, X_VW @ X_WA, b, X_VW @ X_WB)
        assert after.distance == pytest.approx(before.distance, abs=NANO)


def test_moving_a_body_changes_the_clearance_by_no_more_than_the_move(pairs):
    rng = stream(8, "test_clearance/lipschitz")
    for a, X_WA, b, X_WB in pairs[-300:]:
        step = rng.normal(size=2) * 0.01
        moved = SE2(X_WB.x + step[0], X_WB.y + step[1], X_WB.yaw)
        change = measure(a, X_WA, b, moved).distance - measure(a, X_WA, b, X_WB).distance
        assert abs(change) <= np.linalg.norm(step) + 1e-9


def test_minimum_is_the_first_of_all_pairs():
    rng = stream(9, "test_clearance/minimum")
    bodies = {name: random_body(rng) for name in "abcdef"}
    model = ClearanceModel(bodies, fixed={"e", "f"})
    for _ in range(100):
        poses = {name: random_pose(rng, spread=1.5) for name in bodies}
        everything = model.query(poses)
        assert len(everything) == 14  # 15 pairs less the one of two fixed bodies
        assert [c.distance for c in everything] == sorted(c.distance for c in everything)
        assert model.minimum(poses) == everything[0]  # equal to the bit
        exempt = {everything[0].pair}
        assert exempt.isdisjoint({c.pair for c in model.query(poses, exempt)})
        assert model.minimum(poses, exempt) == everything[1]
        others = {name: X for name, X in poses.items() if name != "a"}
        nearest = next(c for c in everything if "a" in c.pair)
        for bound in (nearest.distance, math.nextafter(nearest.distance, math.inf), rng.uniform(-0.1, 0.5)):
            # A new model as well, which has measured nothing yet.
            for either in (model, ClearanceModel(bodies)):
                assert either.nearest("a", poses["a"], others) == nearest
                within = {b for b in others if either.within("a", poses["a"], b, others[b], bound)}
                assert within == {
                    min(c.pair - {"a"}) for c in everything if "a" in c.pair and c.distance < bound
                }
    assert model.nearest("a", SE2(), {}) is None


def test_earlier_measurements_change_no_result():
    """A walk of three bodies in small and large steps, for a model with a past and for a new one."""
    rng = stream(10, "test_clearance/walk")
    bodies = {"a": unit_parts(UNIT), "b": unit_parts(UNIT), "c": random_body(rng)}
    old = ClearanceModel(bodies)
    poses = {name: random_pose(rng, spread=0.5) for name in bodies}
    for i in range(300):
        name, size = "abc"[i % 3], 0.3 if i % 50 == 0 else 0.01
        poses[name] = poses[name] @ SE2(*rng.normal(0.0, size, 3))
        everything = ClearanceModel(bodies).query(poses)
        assert old.minimum(poses) == everything[0]
        if i % 4 == 0:  # else what the search for the smallest has found out stays as it is
            assert old.query(poses) == everything


def test_a_pair_of_which_neither_has_moved_is_not_measured_again(monkeypatch):
    rng = stream(11, "test_clearance/parked")
    bodies = {name: random_body(rng) for name in "abcd"}
    poses = {name: random_pose(rng, spread=2.0) for name in bodies}
    model = ClearanceModel(bodies)
    nearest, everything = model.minimum(poses), model.query(poses)
    measured, measure = [], PartPair.measure
    monkeypatch.setattr(PartPair, "measure", lambda pair: measured.append(pair) or measure(pair))
    assert model.minimum(poses) is nearest
    assert model.query(poses) == everything
    assert not measured
    last = everything[-1]
    poses[last.body_a] = poses[last.body_a] @ SE2(0.01, 0.0, 0.0)
    assert model.query(poses) != everything
    assert measured


def test_the_footprint_includes_the_pins():
    model = ClearanceModel.from_scene(load_scene("close_range"))
    (front,) = model.query({"a": SE2(), "b": SE2(1.0, 0.0, math.pi / 2)})
    face = UNIT.port("front").x
    assert front.distance < 1.0 - face - 0.1 - 0.01
    # Seated pins overlap the other body, which is why the judge may exempt a pair.
    (seated,) = model.query({"a": SE2(-2 * face, 0.0, 0.0), "b": SE2()})
    assert seated.distance < -0.01
    assert model.query({"a": SE2(-2 * face, 0.0, 0.0), "b": SE2()}, exempt={seated.pair}) == ()
    assert model.minimum({"a": SE2(-2 * face, 0.0, 0.0), "b": SE2()}, exempt={seated.pair}) is None


def test_an_unknown_body_is_refused_by_name():
    with pytest.raises(UnknownNameError, match="unknown body 'aa'; did you mean 'a'"):
        ClearanceModel.from_scene(load_scene("close_range")).query({"aa": SE2()})


def test_two_units_cost_less_than_a_fifth_of_a_millisecond(cost_s):
    model, angles = ClearanceModel.from_scene(load_scene("close_range")), itertools.count()
    assert cost_s(lambda: model.minimum({"a": SE2(-0.25, 0.0, 1e-4 * next(angles)), "b": SE2()})) < 2e-4
