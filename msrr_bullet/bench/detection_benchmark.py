"""The report of ``msrr bench detection``: what each setting of the tag detection is worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from pydantic import BaseModel
from rich.box import SIMPLE_HEAD
from rich.table import Table

from msrr_bullet.bench.detection_metrics import LARGE_EDGE_PX, DetectionRow
from msrr_bullet.bench.onboard_views import DISTANCES_M, measure_onboard
from msrr_bullet.bench.overhead_views import EXPOSURES, measure_overhead, module_sizes
from msrr_bullet.bench.photograph_benchmark import PhotographRow, benchmark_photographs
from msrr_bullet.trial.versions import package_versions

#: Read noise [grey levels] and blur [px] of the harder case.
HARD_NOISE_GREY = 8.0
HARD_BLUR_PX = 1.0

#: Width of a pose error in the tables [characters].
_POSE_WIDTH = 5


class DetectionCase(BaseModel, frozen=True):
    """All settings on the same pixels.

    Attributes:
        title: Camera and image quality.
        rows: One row for each of the settings.
    """

    title: str
    rows: tuple[DetectionRow, ...]


class DetectionBenchmark(BaseModel, frozen=True):
    """All measurements of the detection, made in one process.

    Attributes:
        onboard: Docking unit's camera of scene ``close_range``.
        onboard_hard: Docking unit's camera with more noise and blur.
        overhead: Overhead camera of scene ``two_obstacles``.
        overhead_hard: Overhead camera with more noise and blur.
        photographs: Detectors on photographs; none unless they were given.
        versions: Versions of the packages.
    """

    onboard: DetectionCase
    onboard_hard: DetectionCase
    overhead: DetectionCase
    overhead_hard: DetectionCase
    photographs: tuple[PhotographRow, ...]
    versions: dict[str, str]

    @property
    def cases(self) -> tuple[DetectionCase, ...]:
        """All cases in the order in which they are shown."""
        return self.onboard, self.onboard_hard, self.overhead, self.overhead_hard


def benchmark_detection(
    *,
    seed: int = 0,
    views: int = 20,
    arrangements: int = 4,
    exposures: int = EXPOSURES,
    photographs: Path | None = None,
    observer: Callable[[str], None] = lambda _: None,
) -> DetectionBenchmark:
    """Compare the settings.

    Args:
        seed: Seed of all views.
        views: Views from the docking unit's camera for each stratum of distance.
        arrangements: Arrangements of bodies below the overhead camera.
        exposures: Exposures of each arrangement.
        photographs: Folder of photographs and the list of their tags; None without.
        observer: Called with the name of what is measured next.

    Raises:
        PictureError: The photographs or their list cannot be read.
    """
    on_photographs = () if photographs is None else benchmark_photographs(photographs, observer)
    near, far = DISTANCES_M[0], DISTANCES_M[-1]
    small, large = module_sizes()
    onboard = f"Onboard, {near:g} to {far:g} m"
    overhead = f"Overhead, {small:.1f} to {large:.1f} px a module"
    hard = f"noise {HARD_NOISE_GREY:g}, blur {HARD_BLUR_PX:g} px"
    observer(onboard)
    plain = measure_onboard(views, seed)
    observer(f"{onboard}, {hard}")
    harder = measure_onboard(views, seed, noise_grey=HARD_NOISE_GREY, blur_px=HARD_BLUR_PX)
    observer(overhead)
    above = measure_overhead(arrangements, seed, exposures=exposures)
    observer(f"{overhead}, {hard}")
    above_harder = measure_overhead(
        arrangements, seed, noise_grey=HARD_NOISE_GREY, blur_px=HARD_BLUR_PX, exposures=exposures
    )
    return DetectionBenchmark(
        onboard=DetectionCase(title=f"{onboard}, as designed", rows=plain),
        onboard_hard=DetectionCase(title=f"{onboard}, {hard}", rows=harder),
        overhead=DetectionCase(title=f"{overhead}, as designed", rows=above),
        overhead_hard=DetectionCase(title=f"{overhead}, {hard}", rows=above_harder),
        photographs=on_photographs,
        versions=package_versions(),
    )


def detection_tables(report: DetectionBenchmark) -> tuple[Table, ...]:
    """Return the report as tables for a terminal: for each case what is found, and how exact it is."""
    tables = [table for case in report.cases for table in (_recall_table(case), _accuracy_table(case))]
    if report.photographs:
        tables.append(_photograph_table(report.photographs))
    return tuple(tables)


def _recall_table(case: DetectionCase) -> Table:
    columns = "recall [%]", "95 % interval", "tags", "false", "no pose", "1000 px", "time [ms]"
    rows = [
        (
            row.settings,
            f"{100.0 * row.recall.rate:.1f}",
            f"{100.0 * row.recall.low:.1f}..{100.0 * row.recall.high:.1f}",
            f"{row.tags:.2f}",
            str(row.false),
            str(row.poseless),
            f"{1e-3 * row.pixels:.1f}",
            f"{row.ms:.2f}",
        )
        for row in case.rows
    ]
    table = _table(f"{case.title}: per exposure", columns, rows)
    table.caption = f"{case.rows[0].exposures} exposures; false and no pose: in all of them"
    return table


def _accuracy_table(case: DetectionCase) -> Table:
    columns = "corner RMS", "large tags", "mean x", "mean y [px]", "50 %", "95 % [mm]", "50 %", "95 % [deg]"
    rows = [
        (
            row.settings,
            _number(row.rms_px, ".3f"),
            _number(row.rms_large_px, ".3f"),
            *(_number(b, "+.3f") for b in row.bias_px or (None, None)),
            *(_short(q) for q in (row.distance_mm.p50, row.distance_mm.p95)),
            *(_short(q) for q in (row.yaw_deg.p50, row.yaw_deg.p95)),
        )
        for row in case.rows
    ]
    table = _table(f"{case.title}: accuracy", columns, rows)
    table.caption = f"large tags: every edge above {LARGE_EDGE_PX:g} px"
    return table


def _photograph_table(rows: Sequence[PhotographRow]) -> Table:
    columns = "found", "false", "compared", "corner RMS", "median [px]", "time [ms]"
    texts = [
        (
            row.detector,
            f"{row.found} of {row.tags}",
            str(row.false),
            str(row.aligned),
            _number(row.rms_px, ".3f"),
            _number(row.median_px, ".3f"),
            f"{row.ms:.1f}",
        )
        for row in rows
    ]
    table = _table("Photographs", columns, texts)
    table.caption = "corners: RMS of a coordinate, median distance, from the whole pattern's alignment"
    return table


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    # Without frames, and headings wrap to the width of the figures: a table has to fit 80 columns.
    table = Table(
        title=f"\n{title}",
        title_justify="left",
        caption_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    for i, column in enumerate(("settings", *columns)):
        widest = max(map(len, [*column.split(), *(row[i] for row in rows)]))
        table.add_column(column, justify="right" if i else "left", width=widest)
    for row in rows:
        table.add_row(*row)
    return table


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _short(value: float | None) -> str:
    """Return a number with as many decimals as :data:`_POSE_WIDTH` characters hold, three at most."""
    texts = ("-",) if value is None else tuple(f"{value:.{digits}f}" for digits in (3, 2, 1, 0))
    return next((text for text in texts if len(text) <= _POSE_WIDTH), texts[-1])
