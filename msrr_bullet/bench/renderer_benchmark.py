"""The report of ``msrr bench cameras``: what the renderers cost and how exact they are."""

from __future__ import annotations

from collections.abc import Callable

from pydantic import BaseModel
from rich.table import Table

from msrr_bullet.bench.renderer_measurements import (
    PIXEL_TOLERANCE,
    CornerRow,
    CostRow,
    PixelRow,
    RangeRow,
    compare_pixels,
    measure_corners,
    measure_costs,
    measure_poses,
)
from msrr_bullet.bench.renderer_scenes import CANDIDATES
from msrr_bullet.trial.versions import package_versions


class RendererBenchmark(BaseModel, frozen=True):
    """All measurements of the renderers, made in one process.

    Attributes:
        costs: Time per picture.
        corners: Tag corners against exact projection.
        ranges: Detection and pose over distance.
        pixels: Pixels against a finely sampled reference.
        versions: Versions of the packages.
    """

    costs: tuple[CostRow, ...]
    corners: tuple[CornerRow, ...]
    ranges: tuple[RangeRow, ...]
    pixels: PixelRow
    versions: dict[str, str]


def benchmark_renderers(
    *,
    seed: int = 0,
    repeats: int = 10,
    views: int = 200,
    frames: int = 40,
    distances_m: tuple[float, ...] = (0.1, 0.2, 0.4, 0.6, 0.8),
    clutter_scenes: int = 40,
    observer: Callable[[str], None] = lambda _: None,
) -> RendererBenchmark:
    """Compare the renderers.

    Args:
        seed: Seed of all random views.
        repeats: Timings of each picture, of which the shortest counts.
        views: Views of a single tag for the corner errors.
        frames: Frames per distance and renderer.
        distances_m: Distances between the two faces [m].
        clutter_scenes: Scenes of clutter for the comparison by pixel.
        observer: Called with the name of what is measured next.
    """
    observer("time per picture")
    costs = measure_costs(repeats)
    observer("corners against exact projection")
    corners = measure_corners(views, seed)
    observer("detection and pose over distance")
    ranges = tuple(row for d in distances_m for row in measure_poses(d, frames, seed))
    observer("pixels against 8 x 8 samples")
    pixels = compare_pixels(range(seed, seed + clutter_scenes))
    return RendererBenchmark(
        costs=costs, corners=corners, ranges=ranges, pixels=pixels, versions=package_versions()
    )


def renderer_tables(report: RendererBenchmark) -> tuple[Table, ...]:
    """Return the report as tables for a terminal."""
    costs = _table("Time per picture [ms of processor time]", "", *CANDIDATES, "tiny 1x / raster")
    for cost in report.costs:
        costs.add_row(cost.view, *(f"{cost.ms[c]:.2f}" for c in CANDIDATES), f"{cost.ratio:.1f}")
    corners = _table(
        "Corners against exact projection, no noise, any roll [px]", "", "found", "mean x", "mean y", "RMS"
    )
    for c in report.corners:
        corners.add_row(
            c.renderer,
            f"{c.found} of {c.views}",
            *(f"{b:+.4f}" for b in c.bias_px),
            f"{c.rms_px:.4f}",
        )
    ranges = _table(
        "One frame of close_range's camera, as designed, with its noise and blur",
        "distance",
        "renderer",
        "tags found",
        "lateral RMS [mm]",
        "yaw RMS [deg]",
    )
    for r in report.ranges:
        ranges.add_row(
            f"{r.distance_m:g} m",
            r.renderer,
            f"{100.0 * r.detection_rate:.1f} %",
            f"{r.lateral_mm:.2f}",
            f"{r.yaw_deg:.3f}",
        )
    p = report.pixels
    pixels = _table("Raster against TinyRenderer at 8 x 8 samples", "", "")
    pixels.add_row("scenes, pixels", f"{p.scenes}, {p.pixels}")
    pixels.add_row(f"pixels off by more than {PIXEL_TOLERANCE} grey levels", str(p.off))
    pixels.add_row("largest, mean difference", f"{p.worst}, {p.mean:.2f}")
    return costs, corners, ranges, pixels


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left")
    return table
