"""What hides a point from a camera: by another way of calculation, and by tags that are read of pictures."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from msrr_bullet.render import RenderContext
from msrr_bullet.render.occlusion import hidden_points
from msrr_bullet.render.raster.bodies import LoadedBodies
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.simulation.tag_plates import load_tag_plate
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.pinhole import PinholeCamera, optical_pose
from msrr_scenes.geometry.se3 import SE3
from tests.bullet.render.conftest import add_box, place

#: A tag of 8 x 8 modules, 80 mm wide, 0.5 m ahead of the camera: 8 px per module.
SIZE, MODULES, DISTANCE = 0.08, 8, 0.5
CAMERA = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
WINDOW = CAMERA.frame
X_WC = optical_pose(SE3(p=np.array([0.0, 0.0, 1.0])))

coordinates = st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12)


@given(coordinates)
def test_a_point_is_hidden_where_its_ray_meets_a_triangle_before_it(values: list[float]) -> None:
    a, b, c, point = np.array(values).reshape(4, 3) + np.array([0.0, 0.0, 1.5])
    normal = np.cross(b - a, c - a)
    equations = np.column_stack([point, a - b, a - c])
    assume(abs(np.linalg.det(equations)) > 1e-3)
    t, s, r = np.linalg.solve(equations, a)  # t point = a + s (b - a) + r (c - a)
    assume(min(abs(x) for x in (s, r, 1.0 - s - r)) > 1e-6)
    assume(abs((1.0 - t) * point[2] - 1e-3) > 1e-6)
    assume(abs(t * point[2] - 0.01) > 1e-6)
    met = min(s, r, 1.0 - s - r) > 0.0 and 0.01 < t * point[2] < point[2] - 1e-3
    faces_camera = normal @ a < 0.0
    triangles = np.array([[a, b, c]])
    assert hidden_points(point[None], triangles) == [met and faces_camera]
    assert hidden_points(point[None], triangles[:, ::-1]) == [met and not faces_camera]


def test_nothing_hides_nothing() -> None:
    assert hidden_points(np.ones((3, 3)), np.empty((0, 3, 3))).tolist() == [False] * 3
    assert hidden_points(np.empty((0, 3)), np.ones((1, 3, 3))).shape == (0,)


def test_a_tag_of_which_a_module_is_hidden_is_not_read(client: int, tmp_path: Path) -> None:
    """A dark bar passes a tag, which is read where the bar leaves the tag and its white border free."""
    X_WT = X_WC @ SE3(p=np.array([0.0, 0.0, DISTANCE]))
    load_tag_plate(client, tmp_path, 7, SIZE, X_WT)
    bar = add_box([0.004, 0.012, 0.2], SE3(), 0.1)
    renderer, detector = RasterRenderer(RenderContext(client, samples=1)), PupilDetector()
    across = (np.arange(-1, MODULES + 1) + 0.5) / MODULES - 0.5
    middles = SIZE * np.stack(np.broadcast_arrays(across, across[:, None], 0.0), axis=-1)
    middles_C = middles.reshape(-1, 3) + np.array([0.0, 0.0, DISTANCE])
    counts = {True: 0, False: 0}
    for y in np.arange(-0.08, 0.08, 0.0023):
        place(bar, SE3(p=np.array([0.45, y, 1.0])))
        bodies = LoadedBodies(client)
        hidden = hidden_points(middles_C, X_WC.inverse().act(bodies.triangles(bar))).reshape(10, 10)
        read = [tag.tag_id for tag in detector.detect(renderer.render(CAMERA, X_WC, WINDOW), WINDOW)] == [7]
        if hidden[1:-1, 1:-1].any():
            assert not read, y
            counts[False] += 1
        elif not hidden.any():
            assert read, y
            counts[True] += 1
    assert min(counts.values()) > 15, counts
