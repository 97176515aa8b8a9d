"""Start regions: the overlap of outlines, and regions that hold every start that can be drawn."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from msrr_scenes import load_scene
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.solid import convex_hull
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.placement.start_regions import distance, obstacle_outline, overlap, spread_over
from msrr_scenes.specs.bodies import BoxSpec, CylinderSpec
from msrr_scenes.specs.spec import PoseSpec, Spread

polygons = st.integers(0, 10_000).map(
    lambda seed: convex_hull(
        np.random.default_rng(seed).normal(size=(7, 2)) + np.random.default_rng(seed + 1).uniform(-2, 2, 2)
    )
)


@given(polygons, polygons)
def test_overlap_agrees_with_sampled_points(a: np.ndarray, b: np.ndarray) -> None:
    rng = np.random.default_rng(0)

    def inside(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
        edge = np.roll(outline, -1, axis=0) - outline
        rel = points[:, None] - outline[None]
        return np.all(edge[None, :, 0] * rel[..., 1] - edge[None, :, 1] * rel[..., 0] > 1e-9, axis=1)

    weights = rng.dirichlet(np.ones(len(a)) * 0.5, size=2000)
    common = inside(weights @ a, a) & inside(weights @ a, b)
    assert overlap(a, b) == overlap(b, a)
    if common.any():
        assert overlap(a, b)


@given(polygons, polygons)
def test_the_distance_of_outlines_is_that_of_their_nearest_points(a: np.ndarray, b: np.ndarray) -> None:
    share = np.linspace(0.0, 1.0, 200)[:, np.newaxis, np.newaxis]
    rims = [((1.0 - share) * one + share * np.roll(one, -1, axis=0)).reshape(-1, 2) for one in (a, b)]
    step = max(np.linalg.norm(one - np.roll(one, -1, axis=0), axis=1).max() for one in (a, b)) / 199.0
    nearest = cKDTree(rims[0]).query(rims[1])[0].min()
    assert distance(a, b) == pytest.approx(distance(b, a))
    assert distance(a, b) <= nearest + 1e-9
    assert overlap(a, b) or distance(a, b) > nearest - step


def test_the_outline_of_an_obstacle_is_that_of_its_shape() -> None:
    """A polygon holds the circle, and no point of it is farther out than its corners need to be."""
    post = obstacle_outline(CylinderSpec(shape="cylinder", radius_m=0.2))
    edge = np.roll(post, -1, axis=0) - post
    to_sides = (post[:, 0] * edge[:, 1] - post[:, 1] * edge[:, 0]) / np.linalg.norm(edge, axis=1)
    np.testing.assert_allclose(to_sides, 0.2)
    assert np.linalg.norm(post, axis=1).max() < 0.201
    box = obstacle_outline(BoxSpec(shape="box", length_m=0.4, width_m=0.2))
    np.testing.assert_allclose(np.ptp(box, axis=0), [0.4, 0.2])
    np.testing.assert_allclose(box.mean(axis=0), 0.0, atol=1e-15)


#: A spread, or none: the hull takes what is below a micrometre for none, and turns the region by as much.
SPREADS = st.just(0.0) | st.floats(1e-4, 0.3)


@settings(deadline=None, max_examples=60)
@given(
    SPREADS,
    SPREADS,
    st.floats(0.0, 200.0),
    st.floats(-180.0, 180.0),
    st.integers(0, 1000),
)
@example(0.0, 0.25, 0.0, 89.99999999999997, 0)
def test_a_region_holds_every_start(x: float, y: float, yaw: float, middle: float, seed: int) -> None:
    pose = PoseSpec(x_m=0.3, y_m=-0.2, yaw_deg=middle, spread=Spread(x_m=x, y_m=y, yaw_deg=yaw))
    outline = np.array([[0.12, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.12, -0.1]])
    region = spread_over(pose, outline)
    edge = np.roll(region, -1, axis=0) - region
    rng = np.random.default_rng(seed)
    for dx, dy, dyaw in rng.uniform(-1, 1, (50, 3)):
        start = SE2(0.3 + x * dx, -0.2 + y * dy, np.radians(middle + yaw * dyaw))
        rel = start.act(outline)[:, None] - region[None]
        assert np.all(edge[:, 0] * rel[..., 1] - edge[:, 1] * rel[..., 0] > -1e-9)


@pytest.mark.parametrize("yaw_deg", [0.0, 3.0, 20.0, 300.0])
def test_a_region_is_hardly_larger_than_what_is_reached(yaw_deg: float) -> None:
    """Turned by steps of at most 5 degrees, a point is at most 1 / cos(2.5 deg) too far out."""
    outline = np.array([[0.12, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.12, -0.1]])
    pose = PoseSpec(x_m=0.3, y_m=-0.2, spread=Spread(x_m=0.05, y_m=0.1, yaw_deg=yaw_deg))
    turns = np.radians(np.linspace(-yaw_deg, yaw_deg, 2001))
    reached = np.concatenate([SE2(0.3, -0.2, turn).act(outline) for turn in turns])
    spread = np.array([0.05, 0.1])
    least, most = reached.min(axis=0) - spread, reached.max(axis=0) + spread
    region, slack = spread_over(pose, outline), 0.16 * (1.0 / np.cos(np.radians(2.5)) - 1.0)
    np.testing.assert_allclose([region.min(axis=0), region.max(axis=0)], [least, most], rtol=0, atol=slack)


def test_checked_spreads_never_overlap_when_drawn() -> None:
    spread = "{x_m: -0.2, y_m: 0.42, yaw_deg: 45, spread: {x_m: 0.1, y_m: 0.05, yaw_deg: 90}}"
    scene = load_scene("bystander", {"units.c.pose": spread})
    footprints = {unit: scene.geometry(unit).footprint for unit in scene.units}
    for seed in range(200):
        placed = draw_placement(
            scene, lambda name, s=seed: np.random.default_rng([s, len(name), ord(name[-1])])
        )
        outlines = {unit: X.act(footprints[unit]) for unit, X in placed.units.items()}
        assert not overlap(outlines["a"], outlines["c"])
        assert not overlap(outlines["b"], outlines["c"])
