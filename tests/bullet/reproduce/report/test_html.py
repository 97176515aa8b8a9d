"""The report: every table, figure and sentence stands in one page, and text is escaped."""

import math
from pathlib import Path

import numpy as np

from msrr_bullet.reproduce.report.balance import balances
from msrr_bullet.reproduce.report.findings import lag_text
from msrr_bullet.reproduce.report.html import strip_title, write_report
from msrr_bullet.studies.model import Ablations, Count, Measured, Reproduction, Row, Table, rates_of
from tests.bullet.reproduce.report.conftest import LONG


def row(label: str, settling: list[float], **optional: object) -> Row:
    """A row of trials of the close phase."""
    trials = len(settling)
    every = np.ones(trials, dtype=bool)
    others = {key: Measured.of([0.001] * trials) for key in ("final", "port", "lateral", "yaw")}
    return Row(
        controller="c1",
        label=label,
        trials=trials,
        **rates_of(success=every, in_view=every, in_cone=every),
        measures={"settling": Measured.of(settling), **others},
        **optional,
    )


def cells(line: str) -> list[str]:
    return [cell.partition("</td>")[0] for cell in line.split("<td>")[1:]]


def test_a_row_has_a_cell_for_every_column(tmp_path: Path) -> None:
    complete = row(
        "C1",
        [1.0] * 18 + [math.inf] * 2,
        met={"settling": Count(n=18, of=20)},
        outcomes={"docked": 19, "jammed": 1},
        within_paper=17,
    )
    table = Table(
        phase="close",
        plant="bullet",
        setting="hard starts",
        description="a scene",
        rows=(complete, row("C2", [math.nan] * 20)),
    )
    page = write_report(
        Reproduction(versions={}, seeds={}, tables=(table,)), {}, tmp_path / "r.html"
    ).read_text()
    assert "<p class=note>a scene. Verdicts: C1: 19 docked, 1 jammed</p>" in page
    head = page[page.index("<th>trials") : page.index("</thead>", page.index("<th>trials"))]
    assert head.count("<th>") == 2 + 2 + 5 + 1
    c1, c2, *paper = [cells(" ".join(r.split())) for r in page.split("<tr><td>C1")[1].split("<tr>")]
    c1 = ["C1", *c1]
    rate = "100.0 %<br><small>83.9 .. 100.0</small>"
    settling = "1 / never (2 never)<br><small>18 of 20 within</small>"
    assert c1 == [
        "C1",
        "20",
        rate,
        rate,
        rate,
        settling,
        "1 / 1",
        "1 / 1",
        "1 / 1",
        "0.0573 / 0.0573",
        "17 of 20",
    ]
    assert c2 == ["C2", "20", rate, rate, rate, "-", "1 / 1", "1 / 1", "1 / 1", "0.0573 / 0.0573", ""]
    assert paper[0] == ["paper's C1", "1", "-", "-", "-", "4", "7", "-", "-", "-", ""]
    assert paper[1] == ["paper's C2", "1", "-", "-", "-", "-", "44", "-", "-", "-", ""]


def test_text_is_escaped(tmp_path: Path) -> None:
    table = Table(
        phase="close", plant="bullet", setting="<b>", description="a & b", rows=(row("<i>", [1.0]),)
    )
    figure = tmp_path / "figure.png"
    figure.write_bytes(b"png")
    results = Reproduction(versions={"<u>": "1"}, seeds={}, tables=(table,))
    page = write_report(results, {strip_title(table): figure}, tmp_path / "r.html").read_text()
    assert "close phase, &lt;b&gt;</h3>" in page
    assert "a &amp; b" in page
    assert "<td>&lt;i&gt;</td>" in page
    assert "&lt;u&gt; 1" in page
    assert '<img alt="Strips, bullet, close, &lt;b&gt;" src="data:image/png;base64,cG5n">' in page


def test_both_distances_stand_in_the_report(tmp_path: Path) -> None:
    results = Reproduction(versions={}, seeds={}, tables=(LONG,))
    page = write_report(results, {}, tmp_path / "r.html").read_text()
    heads = ["amplitude to the desired point [m]; within 0.3", "amplitude to the path [m]"]
    heads += ["recovery to the desired point [s]; within 3", "recovery to the path [s]"]
    for text in (*heads, *lag_text(results)):
        assert text in page


def test_figures_with_too_few_trials_are_named_in_the_report(tmp_path: Path) -> None:
    rows = (row("C1", [1.0] * 39), row("CBF", [9.0] * 39))
    table = Table(phase="close", plant="unicycle", setting="standard", description="", rows=rows)
    page = write_report(
        Reproduction(versions={}, seeds={}, tables=(table,)), {}, tmp_path / "r.html"
    ).read_text()
    assert "unicycle, close phase; too few trials: time to stay under 15 mm, 95th percentile, " in page


def test_the_effect_of_each_part_is_in_the_report(tmp_path: Path) -> None:
    rows = (row("C1", [1.0] * 40), row("without it", [9.0] * 40))
    table = Table(phase="close", plant="unicycle", setting="standard", description="", rows=rows)
    ablations = Ablations(phase="close", tables=(table,))
    results = Reproduction(versions={}, seeds={}, ablations=(ablations,))
    page = write_report(results, {}, tmp_path / "r.html").read_text()
    (balance,) = balances(results)
    assert balance.other == "C1 without it"
    (text,) = balance.better
    assert text.startswith("time to stay under 15 mm, 95th percentile 1 instead of 9 s")
    assert f"<li>{text}</li>" in page
