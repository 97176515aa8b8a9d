"""What was built otherwise than designed, against the projection by which a filter explains it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from msrr_perception.kernels.calibrated import BORDER, CLOCK, EDGE, K1, PARAMETERS, project_tag
from msrr_perception.kernels.edges import END_SHARE, SECTIONS
from msrr_perception.kernels.rates import AT_REST, Rates
from msrr_perception.pose.calibration import POSE_SIZE
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.as_built import BuiltCamera
from msrr_scenes.as_built.draw import draw_as_built
from msrr_scenes.geometry.pinhole import optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.loading.load import load_scene
from tests.perception.conftest import project

#: Errors of a scene, one after the other.
GROUPS = {
    "onboard.x_m": 0.003,
    "onboard.y_m": 0.003,
    "onboard.z_m": 0.003,
    "onboard.roll_deg": 3.0,
    "onboard.pitch_deg": 3.0,
    "onboard.yaw_deg": 3.0,
    "onboard.focal_percent": 2.0,
    "onboard.cx_px": 4.0,
    "onboard.cy_px": -4.0,
    "onboard.k1": 0.05,
    "tags.print_percent": 2.0,
    "tags.x_m": 0.001,
    "tags.y_m": 0.001,
    "tags.z_m": 0.001,
    "tags.roll_deg": 1.0,
    "tags.pitch_deg": 1.0,
    "tags.yaw_deg": 1.0,
    "bracket.x_m": 0.003,
    "bracket.y_m": 0.003,
    "bracket.yaw_deg": 1.0,
    "bracket.z_m": 0.003,
    "bracket.roll_deg": 1.0,
    "bracket.pitch_deg": 1.0,
}

#: Largest error of a projection [px], of what is shown of the bow of an edge, to first order in k1, and of
#: the place of a tag, to first order in the angles of what holds it.
EXACT_PX, BOW_PX, PLACE_PX = 1e-9, 3e-4, 0.02
X_DU = SE2(-0.42, 0.03, math.radians(5.0))


def _true_pixels(name: str, error: float) -> tuple[TargetModel, dict[int, np.ndarray]]:
    """Return what a robot is told, and the true pixels of the tags of the port as they were built."""
    given = {f"as_built.{name}.error": str(error), f"as_built.{name}.sigma": "0.01"}
    scene = load_scene("close_range", {"as_built": "perfect", **given})
    step = scene.docks[0]
    told, built = TargetModel.from_scene(scene.told(), step), draw_as_built(scene, 0)
    own, other = built.units["a"], built.units["b"]
    X_UC = optical_pose(own.camera.mounted(own.geometry.frame("camera")))
    X_TD = SE3.from_se2(other.geometry.dock_frame("rear"))
    X_CD = (SE3.from_se2(X_DU) @ X_UC).inverse()
    slots = {i: s for s, i in scene.tag_ids("b").items()}
    true = {}
    for tag in told.port_tags:
        corners = tag_corners(other.print_scale * scene.tag_size("b", slots[tag]))
        p_D = (X_TD.inverse() @ other.geometry.frame(slots[tag])).act(corners)
        true[tag] = _intersected(own.camera, X_CD.act(p_D))
    return told, true


def _intersected(camera: BuiltCamera, corners_C: np.ndarray) -> np.ndarray:
    """Return where lines intersect that are fitted to the cross sections of the edges of a tag [px]."""
    shares = END_SHARE + (1.0 - 2.0 * END_SHARE) * np.arange(SECTIONS)[:, None] / (SECTIONS - 1)
    lines = []
    for a, b in zip(corners_C, np.roll(corners_C, -1, axis=0), strict=True):
        # Sections are at equal distances in the image, not on the tag.
        a, b = a / a[2], b / b[2]
        points = camera.project(a + shares * (b - a))
        middle = points.mean(axis=0)
        lines.append((middle, np.linalg.svd(points - middle)[2][0]))
    corners = []
    for (p, d), (q, e) in zip(np.roll(np.array(lines), 1, axis=0), lines, strict=True):
        along = np.linalg.solve(np.stack([d, -e], axis=1), q - p)[0]
        corners.append(p + along * d)
    return np.array(corners)


def _projected(told: TargetModel, tag: int, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    pixels, J, layout = np.empty(8), np.empty((8, PARAMETERS)), told.filter_layout
    project_tag(told.optics, layout.tags, layout.index[tag], 0.0, AT_REST, np.zeros(4), state, pixels, J)
    return pixels.reshape(4, 2), J


@pytest.mark.parametrize("name", GROUPS)
def test_a_state_that_knows_the_error_predicts_what_is_seen(name: str) -> None:
    error, tolerance = GROUPS[name], EXACT_PX
    if name == "onboard.k1":
        tolerance = BOW_PX
    elif name.startswith(("tags.", "bracket.")) and name.endswith("_deg"):
        tolerance = PLACE_PX
    told, true = _true_pixels(name, error)
    layout = told.filter_layout
    state = np.zeros(layout.size)
    state[:5] = pose_vector(X_DU)
    drawn = np.concatenate([_projected(told, tag, state)[0] for tag in told.port_tags])
    named = [i for i, q in enumerate(layout.quantities) if q is not None and q.name == name]
    assert {q.tag for i in named if (q := layout.quantities[i])} <= {None, *told.port_tags}
    errors = np.zeros(len(layout.quantities))
    for i in named:
        quantity = layout.quantities[i]
        assert quantity is not None
        errors[i] = error / quantity.scale
    state[POSE_SIZE : layout.first] = errors[: layout.first - POSE_SIZE]
    state[layout.first :] = layout.by_errors @ errors[layout.first - POSE_SIZE :]
    found = layout.errors(state[POSE_SIZE:], np.eye(len(errors)))[0]
    np.testing.assert_allclose(found, errors, atol=1e-12)
    if layout.marker is not None:  # the pose is that against the marker
        x, y, turn = state[layout.marker :]
        px, py, _ = layout.tags.pivot
        X_DM = SE2(px + x, py + y, turn) @ SE2(px, py, 0.0).inverse()
        state[:3] = (X_DM.inverse() @ X_DU).as_array()
    known = np.concatenate([_projected(told, tag, state)[0] for tag in told.port_tags])
    seen = np.concatenate([true[tag] for tag in told.port_tags])
    assert np.abs(seen - drawn).max() > 0.1
    assert np.abs(seen - known).max() <= tolerance


def _accelerated() -> Rates:
    """Return rates with accelerations that differ from one step to the next; the last instant is 15 ms on."""
    times = np.linspace(-0.015, 0.015, 7)
    velocity = np.array([0.1, 0.02, 0.3]) + np.outer(np.sin(100.0 * times), [5e-3, 1e-3, 0.04])
    way = np.zeros((7, 3))
    np.cumsum(2.5e-3 * (velocity[1:] + velocity[:-1]), axis=0, out=way[1:])
    return Rates(float(times[0]), 5e-3, way - way[3], velocity)


@pytest.mark.parametrize("leans", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.1)])
def test_derivatives_are_those_of_the_projection(leans: tuple[float, float, float]) -> None:
    """For a camera that is level and one that is rolled, pitched and turned, on a pair that is tilted."""
    scene = load_scene("close_range", {"as_built": "careful"})
    upright = TargetModel.from_scene(scene.told(), scene.docks[0])
    told = replace(upright, X_UC=upright.X_UC @ SE3.from_xyz_rpy(np.zeros(3), leans))
    layout, rng = told.filter_layout, np.random.default_rng(5)
    rates, h = _accelerated(), 1e-6
    after = np.array([-2e-3, 1e-3, 1e-3, 4e-3])
    state = np.zeros(layout.size)
    state[:5] = pose_vector(SE2(-0.42, 0.03, 0.4), 0.15, -0.2)
    state[layout.first :] = layout.prior * rng.standard_normal(len(layout.prior))
    columns = layout.tags.columns[:, [EDGE, *range(BORDER, PARAMETERS)]]
    state[columns[columns >= 0]] *= 0.1
    for tag, k in layout.index.items():
        J, pixels = np.empty((8, PARAMETERS)), np.empty((3, 8))
        spare = np.empty((8, PARAMETERS))
        project_tag(told.optics, layout.tags, k, 0.3, rates, after, state, pixels[0], J)
        for column in range(PARAMETERS):
            at = layout.tags.columns[k, column]
            if at < 0:
                continue
            e = np.zeros(layout.size)
            e[at] = h
            project_tag(told.optics, layout.tags, k, 0.3, rates, after, state + e, pixels[1], spare)
            project_tag(told.optics, layout.tags, k, 0.3, rates, after, state - e, pixels[2], spare)
            found = (pixels[1] - pixels[2]) / (2.0 * h)
            # But for how the direction of a normal changes, and the bow of an edge.
            assert np.abs(found - J[:, column]).max() < 5e-3 * max(np.abs(found).max(), 1.0), (tag, column)


def test_without_errors_a_tag_is_projected_as_by_the_chain_of_frames(leaning: TargetModel) -> None:
    for pitch, roll in ((0.0, 0.0), (0.15, -0.2), (-0.1, 0.25)):
        state = np.zeros(leaning.filter_layout.size)
        state[:5] = pose_vector(X_DU, pitch, roll)
        for tag in leaning.tags:
            expected = project(leaning, state[:5], leaning.corners_D[tag])[1]
            np.testing.assert_allclose(_projected(leaning, tag, state)[0], expected, atol=1e-9)


def test_a_corner_whose_row_is_exposed_later_is_seen_as_by_a_clock_that_is_behind() -> None:
    scene = load_scene("close_range", {"as_built": "careful"})
    told = TargetModel.from_scene(scene.told(), scene.docks[0])
    layout, after = told.filter_layout, np.array([-12e-3, 5e-3, 0.0, 20e-3])
    rates = _accelerated()
    state, clock = np.zeros(layout.size), layout.tags.columns[0, CLOCK]
    state[:5] = pose_vector(X_DU, 0.01, -0.01)
    rows, J = np.empty(8), np.empty((8, PARAMETERS))
    project_tag(told.optics, layout.tags, 0, 0.0, rates, after, state, rows, J)
    for corner, late in enumerate(-after):
        behind, spare = state.copy(), np.empty((8, PARAMETERS))
        behind[clock] = late
        at_once, of_corner = np.empty(8), slice(2 * corner, 2 * corner + 2)
        project_tag(told.optics, layout.tags, 0, 0.0, rates, np.zeros(4), behind, at_once, spare)
        np.testing.assert_allclose(rows[of_corner], at_once[of_corner], atol=1e-9)
        np.testing.assert_allclose(J[of_corner, :K1], spare[of_corner, :K1], atol=1e-6)


def test_a_tolerance_of_next_to_nothing_can_be_computed_with() -> None:
    scene = load_scene("close_range", {"as_built": "{onboard: {yaw_deg: {sigma: 1e-12}}}"})
    prior = TargetModel.from_scene(scene.told(), scene.docks[0]).filter_layout.prior
    assert np.linalg.cond(np.diag(prior**2)) < 1e13
