"""Projection of a scene into its cameras."""

from __future__ import annotations

import numpy as np

from msrr_bullet.figures.drawing.perspective import Perspective
from msrr_scenes.as_built import as_designed
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.messages import OVERHEAD


def perspective(scene, view, snapshot):
    if view.exposure.camera == OVERHEAD:
        return Perspective.overhead(scene, as_designed(scene))
    unit = view.exposure.camera.partition("/")[0]
    return Perspective.onboard(scene, as_designed(scene), unit, snapshot.units[unit])


def true_corners(scene, snapshot):
    """Return the corners in W, (4, 3) [m], of every tag by its id."""
    found = {}
    for unit, X_WU in snapshot.units.items():
        for slot, tag_id in scene.tag_ids(unit).items():
            X_WT = SE3.from_se2(X_WU) @ scene.geometry(unit).frame(slot)
            found[tag_id] = X_WT.act(tag_corners(scene.tag_size(unit, slot)))
    return found


def test_projected_truth_meets_the_detected_tags(short_log, trial, views):
    """Truth, interpolated at the time of exposure and projected, meets the tags in the pixels."""
    scene = short_log.header.scene
    off = {OVERHEAD: [], "a/onboard": []}
    for view in views:
        snapshot = trial.at(view.stamp_ns)
        camera, corners = perspective(scene, view, snapshot), true_corners(scene, snapshot)
        for tag in view.tags:
            if tag.tag_id in corners:
                off[view.exposure.camera] += list(camera.pixels(corners[tag.tag_id]) - tag.corners)
    for camera, errors in off.items():
        distance = np.linalg.norm(errors, axis=1)
        assert len(distance) >= 40, camera
        assert np.median(distance) < 0.35, camera
        assert distance.max() < 1.5, camera


def test_a_solid_around_the_camera_is_cut_off_in_front_of_it():
    camera = Perspective(PinholeCamera.from_hfov(640, 480, 1.2), SE3())
    cube = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    hull = camera.hull(cube)
    assert np.isfinite(hull).all()
    assert hull[:, 0].min() < 0.0
    assert hull[:, 0].max() > 640.0
    assert len(camera.hull(cube - np.array([0.0, 0.0, 5.0]))) == 0
    (piece,) = camera.line([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(piece, np.full((2, 2), [camera.camera.cx, camera.camera.cy]))


def test_areas_have_the_outlines_of_their_hulls_and_none_outside_the_frame():
    """Some cubes are cut by the near plane. Each is as drawn alone, or left out."""
    camera = Perspective(
        PinholeCamera.from_hfov(640, 480, 1.2), SE3.from_xyz_rpy([0.3, -0.2, 0.1], [0.4, 1.1, -2.0])
    )
    rng = np.random.default_rng(8)
    cube = np.array([[x, y, z] for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.2, 0.2)])
    areas = [cube[: 4 + n % 5] + rng.uniform(-1.0, 1.0, 3) for n in range(200)]
    drawn = outside = 0
    for points, (depth, outline) in zip(areas, camera.areas(areas), strict=True):
        alone = camera.hull(points)
        np.testing.assert_allclose(depth, camera.X_WC.inverse().act(points)[:, 2].mean(), atol=1e-12)
        if len(outline):
            np.testing.assert_array_equal(outline, alone)
            drawn += 1
        elif len(alone):
            low, high = alone.min(axis=0), alone.max(axis=0)
            assert (high < -1.0).any() or (low > [641.0, 481.0]).any()
            outside += 1
    assert drawn > 30
    assert outside > 30
