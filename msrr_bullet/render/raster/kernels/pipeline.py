"""The steps of a frame, in order."""

from __future__ import annotations

from msrr_bullet.render.raster.kernels.compiler import compiler, inlined, kernel
from msrr_bullet.render.raster.kernels.floor import project_floor
from msrr_bullet.render.raster.kernels.mixed_pixels import cover_samples, shade_mixed_pixels
from msrr_bullet.render.raster.kernels.projection import project
from msrr_bullet.render.raster.kernels.records import (
    Floats,
    FloorTexture,
    Geometry,
    Light,
    PixelGrid,
    Textures,
    View,
    Workspace,
)
from msrr_bullet.render.raster.kernels.simple_pixels import shade_simple_pixels
from msrr_bullet.render.raster.kernels.visibility import clear_corners, cover_corners
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Rows of a window that are worked on at a time, so that what is written stays in the processor's cache.
BAND = 128


@inlined
def place_frames(poses: Array, R_WC: Array, p_WC: Array, R_CM: Array, p_CM: Array, R_WM: Array) -> None:
    """Compute rotations in W, and poses seen from C, of the moving frames.

    ``poses`` holds position and quaternion xyzw of each frame in W, shape (M, 7).
    """
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
    grid: PixelGrid,
    poses: Array,
    R_WC: Array,
    p_WC: Array,
    light: Light,
    geometry: Geometry,
    textures: Textures,
    floor_texture: FloorTexture,
    positions: Floats,
    cell_positions: Floats,
    work: Workspace,
    out: Pixels,
) -> None:
    """Draw a window.

    Args:
        view: Camera, and bounds in the image of an ideal lens of what the window shows.
        grid: Corners of the window's pixels.
        poses: Position [m] and quaternion xyzw of each moving frame in W, shape (M, 7).
        R_WC: Rotation of the camera in W, shape (3, 3).
        p_WC: Position of the camera in W, shape (3,) [m].
        light: Light of the scene.
        geometry: All faces.
        textures: Textures of the faces.
        floor_texture: Texture of the floor.
        positions: Positions of the samples in a pixel in which faces meet, shape (2, SAMPLES).
        cell_positions: Positions of the samples where cells of one bitmap meet, shape (2, CELL_SAMPLES).
        work: Memory for windows of this width.
        out: Pixels that are written, shape (height, width).
    """
    place_frames(poses, R_WC, p_WC, work.R_CM, work.p_CM, work.R_WM)
    floor_view = project_floor(floor_texture, view, R_WC, p_WC)
    # The inverse depth of the plane z = 0 is the ray's descent over the camera's height.
    floor = floor_view.forms[2] / max(p_WC[2], 1e-9)
    faces, corners, samples = work.faces, work.corners, work.samples
    count = project(view, light, geometry, work.R_CM, work.p_CM, work.R_WM, work.projected, faces)
    for top in range(0, grid.height, BAND):
        height = min(BAND, grid.height - top)
        rows = out[top : top + height]
        clear_corners(grid, top, height, floor, corners)
        cover_corners(grid, top, height, faces, count, textures.regions, corners, work.row.texel)
        shade_simple_pixels(
            grid,
            top,
            height,
            faces,
            textures,
            floor_texture,
            floor_view,
            corners,
            work.row,
            cell_positions,
            samples,
            rows,
        )
        cover_samples(grid, top, height, faces, count, floor, positions, samples)
        shade_mixed_pixels(
            grid,
            top,
            height,
            faces,
            textures,
            floor_texture,
            floor_view,
            positions,
            cell_positions,
            samples,
            rows,
        )


#: The same for a grid of arrays.
draw_through_lens = compiler.variant(draw, "draw_through_lens")
