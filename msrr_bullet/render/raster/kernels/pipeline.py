"""The steps of a frame, in order."""

from __future__ import annotations

from msrr_bullet.render.raster.kernels.compiled import inlined, kernel
from msrr_bullet.render.raster.kernels.ground import view_ground
from msrr_bullet.render.raster.kernels.projection import project
from msrr_bullet.render.raster.kernels.records import (
    Geometry,
    Ground,
    Light,
    Pixels,
    Short,
    Textures,
    View,
    Work,
)
from msrr_bullet.render.raster.kernels.resolve import clear_samples, cover_samples, shade_open
from msrr_bullet.render.raster.kernels.settle import settle
from msrr_bullet.render.raster.kernels.visibility import clear, cover_corners
from msrr_scenes.arrays import Array

#: Rows of a window that are worked on at a time, so that what is written stays in the processor's cache.
BAND = 64


@inlined
def place_movers(poses: Array, R_WC: Array, p_WC: Array, R_CM: Array, p_CM: Array, R_WM: Array) -> None:
    """Turn the movers' poses in W (position, quaternion xyzw) into rotations and poses seen from C."""
    for m in range(len(poses)):
        x, y, z, w = poses[m, 3], poses[m, 4], poses[m, 5], poses[m, 6]
        k = 2.0 / (x * x + y * y + z * z + w * w)
        Q = R_WM[m]
        Q[0, 0], Q[0, 1], Q[0, 2] = 1.0 - k * (y * y + z * z), k * (x * y - z * w), k * (x * z + y * w)
        Q[1, 0], Q[1, 1], Q[1, 2] = k * (x * y + z * w), 1.0 - k * (x * x + z * z), k * (y * z - x * w)
        Q[2, 0], Q[2, 1], Q[2, 2] = k * (x * z - y * w), k * (y * z + x * w), 1.0 - k * (x * x + y * y)
        for i in range(3):
            for j in range(3):
                R_CM[m, i, j] = R_WC[0, i] * Q[0, j] + R_WC[1, i] * Q[1, j] + R_WC[2, i] * Q[2, j]
            p_CM[m, i] = (
                R_WC[0, i] * (poses[m, 0] - p_WC[0])
                + R_WC[1, i] * (poses[m, 1] - p_WC[1])
                + R_WC[2, i] * (poses[m, 2] - p_WC[2])
            )


@kernel
def draw(
    view: View,
    poses: Array,
    R_WC: Array,
    p_WC: Array,
    light: Light,
    geometry: Geometry,
    textures: Textures,
    ground: Ground,
    pattern: Short,
    cell_pattern: Short,
    work: Work,
    out: Pixels,
) -> None:
    """Draw a window.

    Args:
        view: Camera and window.
        poses: Position and quaternion xyzw of the movers in W, shape (M, 7).
        R_WC: Rotation of the camera in the world, shape (3, 3).
        p_WC: Its place, shape (3,) [m].
        light: Of the scene.
        geometry: All faces.
        textures: What they wear.
        ground: The floor's texture.
        pattern: Places of the samples in a pixel in which faces meet.
        cell_pattern: Places of the samples where cells of one bitmap meet.
        work: Memory.
        out: The pixels, shape (height, width).
    """
    place_movers(poses, R_WC, p_WC, work.R_CM, work.p_CM, work.R_WM)
    ground_view = view_ground(ground, view.focal, view.middle_x, view.middle_y, R_WC, p_WC)
    # The inverse depth of the plane z = 0 is the ray's descent over the camera's height.
    floor = ground_view.forms[2] / max(p_WC[2], 1e-9)
    faces = work.faces
    count = project(view, light, geometry, work.R_CM, work.p_CM, work.R_WM, work.seen, faces)
    for top in range(0, view.height, BAND):
        band = View(
            view.focal,
            view.middle_x,
            view.middle_y,
            view.x,
            view.y + top,
            view.width,
            min(BAND, view.height - top),
            view.near,
        )
        rows = out[top : top + BAND]
        clear(band, floor, work.corners)
        cover_corners(band, faces, count, textures.regions, work.corners, work.scratch.place)
        settle(
            band,
            faces,
            textures,
            ground,
            ground_view,
            work.corners,
            work.scratch,
            cell_pattern,
            work.samples,
            rows,
        )
        clear_samples(band, floor, pattern, work.samples)
        cover_samples(band, faces, count, pattern, work.samples)
        shade_open(band, faces, textures, ground, ground_view, pattern, cell_pattern, work.samples, rows)
