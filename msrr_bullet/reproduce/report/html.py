"""The report as one HTML file with its figures inside, made from the results alone."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from msrr_bullet.reproduce.report.balance import balances
from msrr_bullet.reproduce.report.comparisons import METHOD, success_text
from msrr_bullet.reproduce.report.findings import lag_text, requirements
from msrr_bullet.reproduce.report.formatting import format_quantiles
from msrr_bullet.reproduce.report.gain_delay_findings import DOCKS, map_text
from msrr_bullet.reproduce.report.ranking import COLUMNS, default_controller_text, ranking
from msrr_bullet.studies.labels import C2, C2_NOTE
from msrr_bullet.studies.model import Reproduction, Table
from msrr_scenes.whole_files import write_whole


def write_report(results: Reproduction, figures: Mapping[str, Path], path: Path) -> Path:
    """Write the report with its figures.

    They are PNG files by title, in the order in which they are shown; a title begins with its section.
    """

    def pictures(section: str) -> list[tuple[str, str]]:
        return [
            (title, base64.b64encode(file.read_bytes()).decode())
            for title, file in figures.items()
            if title == section or title.startswith(f"{section}:")
        ]

    environment = Environment(
        loader=PackageLoader("msrr_bullet.reproduce.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals.update(
        format_quantiles=format_quantiles,
        pictures=pictures,
        success_text=success_text,
        strip_title=strip_title,
    )
    page = environment.get_template("report.html.j2").render(
        results=results,
        requirements=requirements(results),
        balances=balances(results),
        comparison_method=METHOD,
        docks=DOCKS,
        c2_label=C2,
        c2_note=C2_NOTE,
        conclusions=[text for text in (default_controller_text(results), *lag_text(results)) if text],
        ranking_columns=COLUMNS,
        ranking=ranking(results),
        map_text=[map_text(chart) for chart in results.maps],
    )
    write_whole(path, page)
    return path


def strip_title(table: Table) -> str:
    """Return the title of the figure that belongs to a table."""
    return f"Strips, {table.plant}, {table.phase}, {table.setting}"
