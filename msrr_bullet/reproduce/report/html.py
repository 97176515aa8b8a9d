"""The report: one HTML file with its pictures inside, made from what was found and from nothing else."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path

from msrr_bullet.reproduce.report.ablation_findings import ablation_text
from msrr_bullet.reproduce.report.findings import Claim, claims, map_text, winner_text
from msrr_bullet.reproduce.report.lag_findings import lag_text
from msrr_bullet.reproduce.report.two_quantiles import two_quantiles
from msrr_bullet.statistics import Rate
from msrr_bullet.studies.measures import MEASURES, Measure
from msrr_bullet.studies.model import Reproduction, Row, Table

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1b1f24; max-width: 76rem; margin: 2rem auto;
  padding: 0 1rem }
h1, h2, h3 { line-height: 1.25 } h2 { margin-top: 2.5rem; border-bottom: 1px solid #d3d8de }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums }
th, td { padding: .3rem .7rem; text-align: right; border-bottom: 1px solid #e3e6ea; vertical-align: top }
th:first-child, td:first-child { text-align: left; white-space: nowrap }
table.said th, table.said td { text-align: left; white-space: normal } td small { white-space: nowrap }
thead th { border-bottom: 2px solid #8a939c }
td.met { color: #00614a } td.missed { color: #a33f00; font-weight: 600 }
img { max-width: 100%; height: auto; margin: .5rem 0 } .note { color: #57606a }
"""


def write_report(found: Reproduction, figures: Mapping[str, Path], path: Path) -> Path:
    """Write the report.

    Args:
        found: What was found.
        figures: PNG files by title, in the order in which they are shown; a title begins with its section.
        path: File to write.
    """
    view = (
        "<i>Kept in view</i>: both edges of the target stayed in the camera's field of view in every"
        " approach, from the hand-over to the contact; <i>kept in the cone</i>: within the narrower outer"
        " bound of the line of sight. Both by truth. Errors at contact: truth, when the pins first touch"
        " (bullet) or the faces meet (unicycle)."
    )
    off = (
        "<i>To the desired point</i>: which moves along the path by the clock, so that time lost behind an"
        " obstacle counts; the paper's figures stand beside these. <i>To the path</i>: to the nearest point"
        " of the curve, so that only the swing off it counts. Both while passing the obstacle."
    )
    parts = [
        "<h1>The paper's experiments, reproduced</h1>",
        "<p>Zheng, Jiang, Tan, Zhang, Ye, <i>Segmented Safety Docking Control for Mobile Self-Reconfigurable"
        " Robots</i>, beside this project's implementation of its law (C1), of its comparison (C2), and of"
        " other laws. Figures are median / 95th percentile; rates carry their 95 % Wilson interval.</p>",
        f"<p>{view}</p>",
        f"<p>{off}</p>",
        f"<p class=note>{escape(_how(found))}</p>",
    ]
    said = claims(found)
    if said:
        parts += ["<h2>In short</h2>", _claims(said)]
    winner = winner_text(found)
    if winner:
        parts.append(f"<p>{escape(winner)}</p>")
    parts += [f"<p>{escape(text)}</p>" for text in lag_text(found)]
    parts += _tables(found, "unicycle", "Controllers beside the paper: ideal unicycles", figures)
    if found.maps:
        parts.append("<h2>Gain and delay</h2>")
        parts += [f"<p>{escape(text)}</p>" for text in map_text(found)]
        parts += _pictures(figures, "Gain and delay")
    if found.ablations:
        parts.append("<h2>What each part of C1 is worth</h2>")
        for ablation in found.ablations:
            parts.append(
                f"<p>{escape(ablation.phase.capitalize())} phase: of each figure, the setting in which it"
                " changes most, where the 95 % intervals of C1 with and without the part have nothing in"
                " common.</p>"
            )
            parts.append(f"<ul>{''.join(f'<li>{escape(t)}</li>' for t in ablation_text(ablation))}</ul>")
            parts += _pictures(figures, f"Ablations, {ablation.phase}")
            parts += [_table(table) for table in ablation.tables]
    if found.panels:
        parts.append("<h2>One trial over time</h2>")
        parts += _pictures(figures, "Panels")
    parts += _tables(found, "bullet", "The real loop: contact physics and rendered images", figures)
    versions = ", ".join(f"{name} {version}" for name, version in found.versions.items())
    parts.append(f"<p class=note>{escape(versions)}</p>")
    head = (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>Reproduction</title><style>{_STYLE}</style>"
    )
    path.write_text(f"{head}<body>{''.join(parts)}</body></html>\n", encoding="utf-8")
    return path


def _how(found: Reproduction) -> str:
    seeds = "; ".join(f"{plant}: seeds {a} to {b - 1}" for plant, (a, b) in found.seeds.items())
    return f"{seeds}. {sum(found.seconds.values()):.0f} s of computing."


def _claims(said: Iterable[Claim]) -> str:
    rows = "".join(
        f"<tr><td>{escape(c.text)}</td><td>{escape(c.found)}</td>"
        f"<td class={'met' if c.met else 'missed'}>{'met' if c.met else 'missed'}</td></tr>"
        for c in said
    )
    return f"<table class=said><thead><tr><th>asked</th><th>found</th><th></th></tr></thead>{rows}</table>"


def _tables(found: Reproduction, plant: str, title: str, figures: Mapping[str, Path]) -> list[str]:
    tables = [t for t in found.tables if t.plant == plant]
    if not tables:
        return []
    parts = [f"<h2>{escape(title)}</h2>"]
    for table in tables:
        parts += [_table(table), *_pictures(figures, strip_title(table))]
    return parts


def strip_title(table: Table) -> str:
    """Return the title of the figure that belongs to a table."""
    return f"Strips, {table.plant}, {table.phase}, {table.setting}"


def _pictures(figures: Mapping[str, Path], begin: str) -> list[str]:
    return [
        _picture(title, file)
        for title, file in figures.items()
        if title == begin or title.startswith(f"{begin}:")
    ]


def _picture(title: str, file: Path) -> str:
    data = base64.b64encode(file.read_bytes()).decode()
    return f'<img alt="{escape(title)}" src="data:image/png;base64,{data}">'


def _table(table: Table) -> str:
    measures = [m for m in MEASURES[table.phase] if any(m.key in r.measures for r in table.rows)]
    shown = any(r.in_view is not None for r in table.rows)
    good = "docked" if table.plant == "bullet" or table.phase == "close" else "clear of the obstacle"
    heads = ["", "trials", good, *(["kept in view", "kept in the cone"] if shown else [])]
    heads += [
        f"{m.label} [{m.unit}]" + (f"; within {m.scale * m.paper_c1:g}" if m.paper_c1 is not None else "")
        for m in measures
    ]
    heads += (
        ["within every figure of the paper"] if any(r.within_paper is not None for r in table.rows) else []
    )
    rows = [_cells(r, measures, shown) for r in table.rows]
    rows += [
        _paper_cells("paper, C1", [m.paper_c1 for m in measures], measures, shown),
        _paper_cells("paper, C2", [m.paper_c2 for m in measures], measures, shown),
    ]
    rows = [row + [""] * (len(heads) - len(row)) for row in rows]  # the paper says nothing of the last one
    body = "".join("<tr>" + "".join(_cell(c) for c in row) + "</tr>" for row in rows)
    head = "".join(f"<th>{escape(h)}</th>" for h in heads)
    title = f"<h3>{escape(table.phase)} phase, {escape(table.setting)}</h3>"
    note = f"<p class=note>{escape(table.description)}{escape(_outcomes(table))}</p>"
    return f"{title}{note}<table><thead><tr>{head}</tr></thead>{body}</table>"


def _outcomes(table: Table) -> str:
    others = [
        f"{r.label}: {', '.join(f'{n} {name}' for name, n in r.outcomes.items())}"
        for r in table.rows
        if r.outcomes
    ]
    return f". Verdicts: {'; '.join(others)}" if others else ""


def _cells(row: Row, measures: Iterable[Measure], shown: bool) -> list[str]:
    cells = [row.label, str(row.trials), _rate(row.success)]
    if shown:
        cells += [_rate(rate) if rate is not None else "-" for rate in (row.in_view, row.in_cone)]
    cells += [_with_met(row, m) for m in measures]
    if row.within_paper is not None:
        cells.append(f"{row.within_paper} of {row.trials}")
    return cells


def _paper_cells(
    label: str, values: list[float | None], measures: Iterable[Measure], shown: bool
) -> list[str]:
    cells = [label, "1", "-", *(["-", "-"] if shown else [])]
    return cells + ["-" if v is None else f"{m.scale * v:.3g}" for v, m in zip(values, measures, strict=True)]


def _rate(rate: Rate) -> str:
    return f"{100 * rate.rate:.1f} %\n{100 * rate.low:.1f} .. {100 * rate.high:.1f}"


def _cell(text: str) -> str:
    """Return a cell; what stands in a second line is a note to the first."""
    first, _, note = text.partition("\n")
    return f"<td>{escape(first)}{f'<br><small>{escape(note)}</small>' if note else ''}</td>"


def _with_met(row: Row, what: Measure) -> str:
    met = row.met.get(what.key)
    text = two_quantiles(row, what)
    return text if met is None else f"{text}\n{met.n} of {met.of} within"
