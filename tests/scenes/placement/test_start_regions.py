"""Start regions: the overlap of outlines, and regions that hold every start that can be drawn."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from msrr_scenes import load_scene
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.solid import convex_hull
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.placement.start_regions import overlap, spread_over
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
