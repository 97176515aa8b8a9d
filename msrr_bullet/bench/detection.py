"""What the detection's settings are worth: the tables that ``msrr bench detection`` prints."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pydantic import BaseModel, ConfigDict
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from msrr_bullet.bench.detection_metrics import LARGE_EDGE_PX, DetectionRow
from msrr_bullet.bench.onboard_detection import DISTANCES_M, onboard_rows
from msrr_bullet.bench.overhead_detection import EXPOSURES, module_px, overhead_rows
from msrr_bullet.trial.result import package_versions

#: Read noise and blur of the harder case [grey levels, px].
HARD_NOISE_GREY = 8.0
HARD_BLUR_PX = 1.0

#: Characters of a pose error.
_SHORT = 5


class DetectionCase(BaseModel):
    """All settings on the same pixels.

    Attributes:
        title: What was looked at.
        rows: One for each of the settings.
    """

    model_config = ConfigDict(frozen=True)

    title: str
    rows: tuple[DetectionRow, ...]

    def row(self, settings: str) -> DetectionRow:
        """Return the row of some settings.

        Raises:
            KeyError: There is none.
        """
        return {row.settings: row for row in self.rows}[settings]


class DetectionBench(BaseModel):
    """All that is measured of the detection, in one process.

    Attributes:
        onboard: The docking unit's camera, as scene ``close_range`` has it.
        onboard_hard: The same with more noise and blur.
        overhead: The overhead camera, as scene ``two_obstacles`` has it.
        overhead_hard: The same with more noise and blur.
        versions: Packages that ran it.
    """

    model_config = ConfigDict(frozen=True)

    onboard: DetectionCase
    onboard_hard: DetectionCase
    overhead: DetectionCase
    overhead_hard: DetectionCase
    versions: dict[str, str]

    @property
    def cases(self) -> tuple[DetectionCase, ...]:
        """All cases in the order in which they are shown."""
        return self.onboard, self.onboard_hard, self.overhead, self.overhead_hard

    def to_json(self) -> str:
        """Return the report as indented JSON."""
        return self.model_dump_json(indent=2) + "\n"


def bench_detection(
    *,
    seed: int = 0,
    views: int = 20,
    arrangements: int = 4,
    exposures: int = EXPOSURES,
    observer: Callable[[str], None] = lambda _: None,
) -> DetectionBench:
    """Compare the settings.

    Args:
        seed: Of all views.
        views: From the docking unit's camera, for each stratum of distance.
        arrangements: Below the overhead camera.
        exposures: Of each arrangement.
        observer: Is told what is measured next.
    """
    near, far = DISTANCES_M[0], DISTANCES_M[-1]
    small, large = module_px()
    onboard = f"Onboard, {near:g} to {far:g} m"
    overhead = f"Overhead, {small:.1f} to {large:.1f} px a module"
    hard = f"noise {HARD_NOISE_GREY:g}, blur {HARD_BLUR_PX:g} px"
    observer(onboard)
    plain = onboard_rows(views, seed)
    observer(f"{onboard}, {hard}")
    harder = onboard_rows(views, seed, noise_grey=HARD_NOISE_GREY, blur_px=HARD_BLUR_PX)
    observer(overhead)
    above = overhead_rows(arrangements, seed, exposures=exposures)
    observer(f"{overhead}, {hard}")
    above_harder = overhead_rows(
        arrangements, seed, noise_grey=HARD_NOISE_GREY, blur_px=HARD_BLUR_PX, exposures=exposures
    )
    return DetectionBench(
        onboard=DetectionCase(title=f"{onboard}, as the scene has it", rows=plain),
        onboard_hard=DetectionCase(title=f"{onboard}, {hard}", rows=harder),
        overhead=DetectionCase(title=f"{overhead}, as the scene has it", rows=above),
        overhead_hard=DetectionCase(title=f"{overhead}, {hard}", rows=above_harder),
        versions=package_versions(),
    )


def detection_tables(bench: DetectionBench) -> tuple[Table, ...]:
    """Return the report as tables for people: of each case what is found, and how exact it is."""
    return tuple(table for case in bench.cases for table in (_found(case), _exactness(case)))


def _found(case: DetectionCase) -> Table:
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


def _exactness(case: DetectionCase) -> Table:
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
    table = _table(f"{case.title}: exactness", columns, rows)
    table.caption = f"large tags: every edge above {LARGE_EDGE_PX:g} px"
    return table


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    # Without frames, and with headings that give way to figures: it has to fit the 80 columns of a terminal.
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
        table.add_column(escape(column), justify="right" if i else "left", width=widest)
    for row in rows:
        table.add_row(*row)
    return table


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _short(value: float | None) -> str:
    """Return a number with as many decimals as five characters hold, three at most."""
    texts = ("-",) if value is None else tuple(f"{value:.{digits}f}" for digits in (3, 2, 1, 0))
    return next((text for text in texts if len(text) <= _SHORT), texts[-1])
