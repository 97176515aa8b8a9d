"""The steps of a frame that is seen through a lens that distorts, in order."""

from __future__ import annotations

from msrr_bullet.render.raster.kernels.compiler import kernel
from msrr_bullet.render.raster.kernels.floor import project_floor
from msrr_bullet.render.raster.kernels.lens_mixed_pixels import cover_lens_samples, shade_lens_mixed_pixels
from msrr_bullet.render.raster.kernels.lens_simple_pixels import shade_lens_simple_pixels
from msrr_bullet.render.raster.kernels.lens_visibility import clear_lens_corners, cover_lens_corners
from msrr_bullet.render.raster.kernels.pipeline import BAND, place_frames
from msrr_bullet.render.raster.kernels.projection import project
from msrr_bullet.render.raster.kernels.records import (
    Floats,
    FloorTexture,
    Geometry,
    LensView,
    Light,
    Textures,
    View,
    Workspace,
)
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels


@kernel
def draw_through_lens(
    view: View,
    lens: LensView,
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
    maps: Array,
    out: Pixels,
) -> None:
    """Draw a window; the arguments are those of :func:`.pipeline.draw`, but for three.

    Args:
        view: Camera, and bounds in the image of the ideal lens of what the window shows.
        lens: Corners of the window's pixels.
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
        maps: Memory for the maps of the mixed pixels of a band, shape (BAND * width + 1, 6).
        out: Pixels that are written, shape (height, width).
    """
    place_frames(poses, R_WC, p_WC, work.R_CM, work.p_CM, work.R_WM)
    floor_view = project_floor(floor_texture, view, R_WC, p_WC)
    floor = floor_view.forms[2] / max(p_WC[2], 1e-9)
    faces, corners, samples = work.faces, work.corners, work.samples
    count = project(view, light, geometry, work.R_CM, work.p_CM, work.R_WM, work.projected, faces)
    for top in range(0, len(out), BAND):
        height = min(BAND, len(out) - top)
        rows = out[top : top + height]
        clear_lens_corners(lens, top, height, floor, corners)
        cover_lens_corners(lens, top, height, faces, count, textures.regions, corners, work.row.texel)
        shade_lens_simple_pixels(
            lens,
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
            maps,
            rows,
        )
        cover_lens_samples(height, faces, count, floor, positions, samples, maps)
        shade_lens_mixed_pixels(
            lens,
            top,
            height,
            faces,
            textures,
            floor_texture,
            floor_view,
            positions,
            cell_positions,
            samples,
            maps,
            rows,
        )
