"""The bench of the cameras: it runs, its figures make sense, and the raster renderer is the cheaper one."""

from __future__ import annotations

import json

import pytest
from rich.console import Console

from msrr_bullet.bench.cameras import CameraBench, bench_cameras, camera_tables
from msrr_bullet.bench.renderer_scenes import CONTESTANTS


@pytest.fixture(scope="module")
def report() -> CameraBench:
    told: list[str] = []
    bench = bench_cameras(
        repeats=2, views=3, frames=2, distances_m=(0.2,), clutter_scenes=1, observer=told.append
    )
    assert len(told) == 4
    return bench


def test_every_renderer_is_measured(report: CameraBench) -> None:
    for cost in report.costs:
        assert set(cost.ms) == set(CONTESTANTS)
        assert min(cost.ms.values()) > 0.0
    assert [row.renderer for row in report.corners] == list(CONTESTANTS)
    assert all(row.found == 3 for row in report.corners)
    assert [row.renderer for row in report.ranges] == list(CONTESTANTS)
    assert all(row.detection_rate == 1.0 for row in report.ranges)
    raster = report.ranges[-1]
    assert raster.lateral_mm < 2.0
    assert raster.yaw_deg < 0.2
    assert report.pixels.pixels == 320 * 240


def test_raster_is_several_times_cheaper_than_one_sample_of_tiny(report: CameraBench) -> None:
    """Ten times and more by the bench; half of that here, for machines that do other things, too."""
    near = {row.view: row.ratio for row in report.costs if "0.2 m" in row.view}
    assert len(near) == 2
    assert min(near.values()) > 5.0, near


def test_tables_and_json_hold_the_figures(report: CameraBench) -> None:
    console = Console(record=True, width=150)
    for table in camera_tables(report):
        console.print(table)
    text = console.export_text()
    assert "640 x 480 frame, marker at 0.2 m" in text
    assert f"{report.corners[-1].rms_px:.4f}" in text
    assert CameraBench.model_validate(json.loads(report.to_json())) == report
