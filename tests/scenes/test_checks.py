"""Checks across fields: each contradiction is found, placed and mended; what only looks like one is not."""

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_scenes import load_scene
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.solid import convex_hull
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.placement.start_regions import overlap, spread_over
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import PoseSpec, Spread


def load(**overrides: str) -> Scene:
    return load_scene("bystander", {k.replace("__", "."): v for k, v in overrides.items()})


@pytest.mark.parametrize(
    ("overrides", "place", "mend"),
    [
        ({"plan.0.to": "d.rear"}, "plan.0.to", "no unit named 'd'"),
        ({"plan.0.unit": "aa"}, "plan.0.unit", "Units: b, a, c"),
        ({"plan.0.to": "a.rear"}, "plan.0.to", "cannot dock to itself"),
        ({"plan.0.to": "b.front"}, "plan.0.to", "passive ports: rear, left, right"),
        ({"plan.0.to": "b.rera"}, "plan.0.to", "did you mean 'rear'?"),
        ({"plan.0.port": "rear"}, "plan.0.port", "active ports: front"),
        ({"units.a.pose.frame": "a.rear"}, "units.a.pose.frame", "relative to itself"),
        ({"units.b.pose": "{frame: a.rear}"}, "units.b.pose.frame", "(b -> a -> b)"),
        ({"units.a.pose.frame": "d.rear"}, "units.a.pose.frame", "no unit named 'd'"),
        ({"units.a.pose.frame": "b.top"}, "units.a.pose.frame", "Ports: front, rear, left, right"),
        ({"units.c.number": "0"}, "units.c.number", "2 is free"),
        ({"units.a.tag_ids": "{tag_top: 500}"}, "obstacles.post.tag_id", "which a/tag_top has already"),
        ({"units.a.tag_ids": "{tag_top: 587}"}, "units.a.tag_ids.tag_top", "0 .. 586"),
        ({"units.a.tag_ids": "{tag_bottom: 3}"}, "units.a.tag_ids.tag_bottom", "Links with a tag"),
        ({"obstacles.post.tag_id": "11"}, "obstacles.post.tag_id", "which b/"),
        ({"obstacles.post.pose": "{x_m: 0.45}"}, "obstacles.post.pose", "overlaps 'b'"),
        ({"units.a.pose.x_m": "-0.02"}, "units.a.pose", "overlaps 'b' for some start within its spread"),
        ({"units.c.pose.y_m": "1.45"}, "units.c.pose", "enlarge the arena"),
        ({"arena.x_m": "[-0.5, 2]"}, "units.a.pose", "for some start within its spread"),
        ({"arena.x_m": "[2, -2]"}, "arena.x_m", "[low, high]"),
        ({"cameras.overhead": "null"}, "units.c.pose", "no camera sees this unit"),
        ({"cameras.overhead.x_m": "3"}, "units.c.pose", "out of the overhead view"),
        ({"units.a.pose.yaw_deg": "60"}, "units.a.pose", "turn it towards the port"),
        ({"los.half_width_m": "0.08"}, "los.half_width_m", "lower half_width_m below 0.05"),
        ({"los.inner_deg": "31"}, "los.inner_deg", "below los.outer_deg"),
        ({"los.outer_deg": "40"}, "los.outer_deg", "raise cameras.onboard.hfov_deg"),
        ({"limits.v_close_mps": "0.5"}, "limits.v_close_mps", "limits.v_max_mps = 0.4"),
        ({"faults": "[{kind: marker_hidden, unit: d}]"}, "faults.0.unit", "no unit named 'd'"),
        ({"faults": "[{kind: port_plugged, unit: b, port: front}]"}, "faults.0.port", "passive ports"),
        (
            {"faults": "[{kind: port_plugged, unit: b, port: rear, attempts: [0]}]"},
            "faults.0.attempts",
            "from 1",
        ),
        (
            {"faults": "[{kind: camera_blackout, camera: a/onbord, from_s: 0, to_s: 1}]"},
            "faults.0.camera",
            "did you mean 'a/onboard'?",
        ),
        (
            {"faults": "[{kind: camera_blackout, camera: overhead, from_s: 2, to_s: 1}]"},
            "faults.0.to_s",
            "ends before",
        ),
        (
            {"obstacles.a": "{shape: box, length_m: 1, width_m: 1}"},
            "obstacles.a",
            "names of bodies have to differ",
        ),
        ({"units.c.urdf": "none.urdf"}, "units.c.urdf", "no URDF named 'none.urdf'"),
    ],
)
def test_contradictions(overrides: Mapping[str, str], place: str, mend: str) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene("bystander", overrides)
    assert f": {place}: " in str(caught.value)
    assert mend in str(caught.value)


@pytest.mark.parametrize(
    "overrides",
    [
        {"lock.strength_n": "1"},  # weaker than the pull: a trial that ends in lock_failed
        {"obstacles.post.pose": "{x_m: 0.45}", "obstacles.post.appears_at_s": "5"},  # not there at the start
        {"units.c.pose.frame": "a.left", "units.c.pose.x_m": "-0.2", "units.c.pose.y_m": "0"},  # moves with a
        {"cameras.overhead": "null", "units.c.pose": "{x_m: 0.9, y_m: 0.3}"},  # in the view of a
    ],
)
def test_what_is_allowed(overrides: Mapping[str, str]) -> None:
    load_scene("bystander", overrides)


def test_a_unit_that_carries_another_is_compared_in_its_own_frame() -> None:
    # In the world the two regions overlap widely, but c hangs on a and cannot come nearer.
    scene = load_scene(
        "bystander",
        {
            "units.a.pose.spread": "{x_m: 0.05, y_m: 0.10, yaw_deg: 20}",
            "units.c.pose": "{frame: a.rear, x_m: -0.05}",
            "obstacles": "{}",
        },
    )
    assert scene.units["c"].pose.frame == "a.rear"


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


@settings(deadline=None, max_examples=60)
@given(
    st.floats(0.0, 0.3),
    st.floats(0.0, 0.3),
    st.floats(0.0, 200.0),
    st.floats(-180.0, 180.0),
    st.integers(0, 1000),
)
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
    scene = load(
        units__c__pose="{x_m: -0.2, y_m: 0.42, yaw_deg: 45, spread: {x_m: 0.1, y_m: 0.05, yaw_deg: 90}}"
    )
    footprints = {unit: scene.geometry(unit).footprint for unit in scene.units}
    for seed in range(200):
        placed = draw_placement(
            scene, lambda name, s=seed: np.random.default_rng([s, len(name), ord(name[-1])])
        )
        outlines = {unit: X.act(footprints[unit]) for unit, X in placed.units.items()}
        assert not overlap(outlines["a"], outlines["c"])
        assert not overlap(outlines["b"], outlines["c"])
