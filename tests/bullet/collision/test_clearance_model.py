"""Clearance against an exact oracle of the plane, and the laws a distance has to keep."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.collision.footprint import Part, obstacle_parts, simplify, unit_parts
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.loading.load import load_scene
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.bodies import BoxSpec, CylinderSpec

PAIRS = 5_000
#: FCL sees a disc as a sphere of a nanometre about its centre; a few of those are rounding here [m].
NANO = 2e-8
UNIT = read_unit(find_urdf("unit.urdf"))


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def oracle_parts(p, q, r):
    """Signed distance of two convex polygons or points, less r, and the nearest vector from p to q.

    It is the distance of the origin from the polygon of all differences q - p.
    """
    differences = (q[:, None] - p[None]).reshape(-1, 2)
    hull = differences if len(differences) == 1 else differences[ConvexHull(differences).vertices]
    a, b = hull, np.roll(hull, -1, axis=0)
    edge = b - a
    length2 = np.maximum((edge**2).sum(axis=1), 1e-300)
    t = np.clip(-(a * edge).sum(axis=1) / length2, 0.0, 1.0)
    nearest = a + t[:, None] * edge
    distances = np.linalg.norm(nearest, axis=1)
    k = int(np.argmin(distances))
    inside = len(hull) > 2 and bool((cross(edge, -a) >= 0.0).all())
    return (-distances[k] if inside else distances[k]) - r, nearest[k]


def oracle(parts_a, X_WA, parts_b, X_WB):
    found = [
        oracle_parts(X_WA.act(p.core), X_WB.act(q.core), p.radius + q.radius)
        for p in parts_a
        for q in parts_b
    ]
    return min(found, key=lambda entry: entry[0])


def random_polygon(rng):
    n = int(rng.integers(3, 12))
    return Part.polygon(rng.normal(size=(n, 2)) * rng.uniform(0.01, 0.3, size=2) + rng.normal(size=2) * 0.1)


def random_body(rng):
    """A box or a cylinder of any height, a unit, a polygon, or a body of several parts."""
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


def random_pose(rng, spread=0.8):
    return SE2(*(spread * rng.normal(size=2)), rng.uniform(-math.pi, math.pi))


def random_pairs(name, count):
    """Pairs at random poses; every third is moved to touch, every third of the rest to overlap slightly."""
    rng = stream(20260101, f"test_clearance/{name}")
    for i in range(count):
        a, b = random_body(rng), random_body(rng)
        X_WA, X_WB = random_pose(rng), random_pose(rng)
        if i % 3:
            distance, vector = oracle(a, X_WA, b, X_WB)
            if distance > 0.0:
                unit = vector / np.linalg.norm(vector)
                move = distance + (0.0 if i % 3 == 1 else float(rng.uniform(0.0, 0.02)))
                X_WB = SE2(X_WB.x - move * unit[0], X_WB.y - move * unit[1], X_WB.yaw)
        yield a, X_WA, b, X_WB


def measure(a, X_WA, b, X_WB) -> Clearance:
    (only,) = ClearanceModel.from_footprints({"a": a, "b": b}).query({"a": X_WA, "b": X_WB})
    return only


def test_equals_the_oracle_to_a_millimetre_on_5000_pairs():
    errors, apart, touching, overlapping = [], 0, 0, 0
    for a, X_WA, b, X_WB in random_pairs("oracle", PAIRS):
        expected, _ = oracle(a, X_WA, b, X_WB)
        clearance = measure(a, X_WA, b, X_WB)
        errors.append(abs(clearance.distance - expected))
        apart += expected > 1e-3
        touching += abs(expected) <= 1e-9
        overlapping += expected < -1e-9
        if expected < -1e-9:
            assert clearance.distance <= 0.0
    assert min(apart, touching, overlapping) > PAIRS // 8, "the sample does not cover what it should"
    # The issue asks for 1 mm; a micrometre is what there is, so a loss of digits shows early.
    assert max(errors) < 1e-6


def test_nearest_points_lie_on_their_bodies_and_span_the_distance():
    for a, X_WA, b, X_WB in random_pairs("points", 600):
        c = measure(a, X_WA, b, X_WB)
        p, q = np.array([c.point_a]), np.array([c.point_b])
        assert np.linalg.norm(p - q) == pytest.approx(abs(c.distance), abs=NANO)
        for point, parts, X in ((p, a, X_WA), (q, b, X_WB)):
            assert min(part.gap(X.inverse().act(point))[0] for part in parts) < 1e-6


def test_is_symmetric():
    for a, X_WA, b, X_WB in random_pairs("symmetric", 300):
        assert measure(a, X_WA, b, X_WB).distance == pytest.approx(
            measure(b, X_WB, a, X_WA).distance, abs=NANO
        )


def test_does_not_depend_on_where_the_world_frame_is():
    rng = stream(7, "test_clearance/motions")
    for a, X_WA, b, X_WB in random_pairs("motion", 300):
        X_VW = random_pose(rng, spread=3.0)
        before, after = measure(a, X_WA, b, X_WB), measure(a, X_VW @ X_WA, b, X_VW @ X_WB)
        assert after.distance == pytest.approx(before.distance, abs=NANO)


def test_moving_a_body_changes_the_distance_by_no_more_than_the_move():
    rng = stream(8, "test_clearance/lipschitz")
    for a, X_WA, b, X_WB in random_pairs("lipschitz", 300):
        step = rng.normal(size=2) * 0.01
        moved = SE2(X_WB.x + step[0], X_WB.y + step[1], X_WB.yaw)
        change = measure(a, X_WA, b, moved).distance - measure(a, X_WA, b, X_WB).distance
        assert abs(change) <= np.linalg.norm(step) + 1e-9


def test_minimum_is_the_first_of_all_pairs():
    rng = stream(9, "test_clearance/minimum")
    bodies = {name: random_body(rng) for name in "abcdef"}
    model = ClearanceModel.from_footprints(bodies, fixed={"e", "f"})
    for _ in range(200):
        poses = {name: random_pose(rng, spread=1.5) for name in bodies}
        everything = model.query(poses)
        assert len(everything) == 14  # 15 pairs less the one of two fixed bodies
        assert [c.distance for c in everything] == sorted(c.distance for c in everything)
        assert (
            model.minimum(poses) == everything[0]
        )  # to the bit: what may be nearer is measured, not guessed
        exempt = {everything[0].pair}
        assert exempt.isdisjoint({c.pair for c in model.query(poses, exempt)})
        assert model.minimum(poses, exempt) == everything[1]
        others = {name: X for name, X in poses.items() if name != "a"}
        assert model.nearest("a", poses["a"], others) == next(c for c in everything if "a" in c.pair)
    assert model.nearest("a", SE2(), {}) is None


def test_what_was_measured_before_changes_nothing():
    """A walk of three bodies, steps small and large: a model that has seen it all against a new one."""
    rng = stream(10, "test_clearance/walk")
    bodies = {"a": unit_parts(UNIT), "b": unit_parts(UNIT), "c": random_body(rng)}
    old = ClearanceModel.from_footprints(bodies)
    poses = {name: random_pose(rng, spread=0.5) for name in bodies}
    for i in range(300):
        name, size = "abc"[i % 3], 0.3 if i % 50 == 0 else 0.01
        poses[name] = poses[name] @ SE2(*rng.normal(0.0, size, 3))
        assert old.query(poses) == ClearanceModel.from_footprints(bodies).query(poses)
        assert old.minimum(poses) == old.query(poses)[0]


def test_footprint_of_the_unit_is_the_shadow_of_all_its_solids():
    parts = unit_parts(UNIT)
    assert len(parts) <= 4, "a unit should be a few prisms"
    shadows = [Part.polygon(solid.outline()) for solid in UNIT.solids]
    rng = stream(3, "test_clearance/footprint")
    points = rng.uniform(-0.15, 0.15, size=(20_000, 2))
    by_parts = np.min([part.gap(points) for part in parts], axis=0)
    by_solids = np.min([shadow.gap(points) for shadow in shadows], axis=0)
    np.testing.assert_allclose(by_parts, by_solids, atol=3e-4)


def test_pins_stick_out_of_the_front():
    model = ClearanceModel(load_scene("close_range"))
    (front,) = model.query({"a": SE2(), "b": SE2(1.0, 0.0, math.pi / 2)})
    face = UNIT.port("front").x
    assert front.distance < 1.0 - face - 0.1 - 0.01
    # Seated, the pins are inside the other body: an overlap, which is why the judge may exempt a pair.
    (seated,) = model.query({"a": SE2(-2 * face, 0.0, 0.0), "b": SE2()})
    assert seated.distance < -0.01
    assert model.query({"a": SE2(-2 * face, 0.0, 0.0), "b": SE2()}, exempt={seated.pair}) == ()
    assert model.minimum({"a": SE2(-2 * face, 0.0, 0.0), "b": SE2()}, exempt={seated.pair}) is None


def test_concentric_discs_overlap_by_both_radii():
    disc = (Part.disc(0.0, 0.0, 0.2),)
    assert measure(disc, SE2(1, 1, 0), disc, SE2(1, 1, 2)).distance == pytest.approx(-0.4)


def test_simplify_keeps_the_union():
    rng = stream(4, "test_clearance/simplify")
    for _ in range(20):
        parts = [random_polygon(rng) for _ in range(6)]
        fewer = simplify(parts)
        points = rng.uniform(-0.6, 0.6, size=(3_000, 2))
        before = np.min([p.gap(points) for p in parts], axis=0)
        after = np.min([p.gap(points) for p in fewer], axis=0)
        assert (after <= before + 1e-6).all()
        # Only a hole that they enclose may be filled; what is beside the hull of all is beside every hole.
        outside = Part.polygon(np.concatenate([p.core for p in parts])).gap(points) > 0.0
        np.testing.assert_allclose(after[outside], before[outside], atol=3e-4)
        assert len(fewer) <= len(parts)


def test_a_body_that_the_scene_does_not_have_is_refused_by_name():
    with pytest.raises(UnknownNameError, match="unknown body 'aa'; did you mean 'a'"):
        ClearanceModel(load_scene("close_range")).query({"aa": SE2()})


def test_two_units_cost_less_than_a_fifth_of_a_millisecond():
    model = ClearanceModel(load_scene("close_range"))
    times = []
    for i in range(300):
        start = time.perf_counter()
        model.minimum({"a": SE2(-0.25, 0.0, 1e-4 * i), "b": SE2()})
        times.append(time.perf_counter() - start)
    # The quickest tenth: what the work costs when nothing else has the core.
    assert sorted(times)[30] < 2e-4
