"""What a reproduction says, in words and against what is asked; every number is read from the findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from msrr_bullet.reproduce.report.two_quantiles import shown
from msrr_bullet.statistics import Rate, wilson
from msrr_bullet.studies.gain_delay import LAWS
from msrr_bullet.studies.measures import MEASURES, PhaseName, measure
from msrr_bullet.studies.model import GainDelayMap, Reproduction, Row, Table
from msrr_bullet.studies.settings import PAPER_TRAJECTORY
from msrr_scenes.specs.plan import ControlSpec

#: Share of trials from which a cell of the map counts as docking.
DOCKS = 0.95

_PHASES: tuple[PhaseName, ...] = ("long", "close")


@dataclass(frozen=True, slots=True)
class Claim:
    """Something that is asked of the project, and what was found."""

    text: str
    found: str
    met: bool


def claims(found: Reproduction) -> list[Claim]:
    """Return what can be said of what is asked, from the tables at hand."""
    said: list[Claim] = []
    for phase in _PHASES:
        table = found.table(phase, "unicycle", "standard")
        row = _row(table, "C1")
        if table is None or row is None:
            continue
        for what in MEASURES[phase]:
            q = row.measures[what.key].quantiles if what.key in row.measures else None
            if what.asked_p50 is None or what.asked_p95 is None or q is None:
                continue
            p50, p95 = (float("inf") if v is None else v for v in (q.p50, q.p95))
            s, unit = what.scale, what.unit
            said.append(
                Claim(
                    f"C1, unicycle, {table.description}: {what.label}"
                    f" at most {s * what.asked_p50:.3g} / {s * what.asked_p95:.3g} {unit}",
                    f"{shown(p50, what)} / {shown(p95, what)} {unit}",
                    p50 <= what.asked_p50 and p95 <= what.asked_p95,
                )
            )
    said += _of_the_map(found)
    said += _of_the_loop(found)
    return said


def _of_the_map(found: Reproduction) -> list[Claim]:
    maps = [m for m in found.maps if not m.compensated]
    if not maps:
        return []
    one, both, _ = _counts(maps[0])
    return [
        Claim(
            "the map over gain and delay has a region where C1 docks and C2 does not, and one where both do",
            f"{one} cells of C1 alone, {both} of both",
            one > 0 and both > 0,
        )
    ]


def _of_the_loop(found: Reproduction) -> list[Claim]:
    said = []
    tables = [found.table(phase, "bullet", "whole mission") for phase in _PHASES]
    rows = {label: [r for r in (_row(t, label) for t in tables) if r is not None] for label in ("C1", "C2")}
    if rows["C1"]:
        one = rows["C1"][0]
        n = one.within_paper or 0
        text = "; ".join(f"{label}: {_within(of)}" for label, of in rows.items() if of)
        said.append(
            Claim(
                "C1, whole mission, bullet and images: docked and every figure of the paper met in 95 %",
                text,
                n >= 0.95 * one.trials,
            )
        )
    hard = found.table("close", "bullet", "hard starts")
    row = _row(hard, "CBF")
    if row is not None and row.in_view is not None:
        enough = row.in_view.rate == 1.0 and row.success.rate >= 0.97
        said.append(
            Claim(
                "CBF, hard starts, bullet and images: target kept in view in all, docked in 97 %",
                _credentials(row),
                enough,
            )
        )
    return said


def _within(rows: Sequence[Row]) -> str:
    """Return how many trials meet every figure of the paper, and how many each of them."""
    rate = wilson(rows[0].within_paper or 0, rows[0].trials)
    each = ", ".join(
        f"{measure(key).label} {count.n} of {count.of}" for row in rows for key, count in row.met.items()
    )
    return f"{rows[0].within_paper} of {rows[0].trials} ({percent(rate)}): {each}"


def _row(table: Table | None, label: str) -> Row | None:
    return None if table is None else next((r for r in table.rows if r.label == label), None)


def _counts(found: GainDelayMap) -> tuple[int, int, int]:
    """Return in how many cells C1 alone, both, and C2 alone dock."""
    pairs = [
        (a.success >= DOCKS, b.success >= DOCKS)
        for row1, row2 in zip(found.cells["c1"], found.cells["c2"], strict=True)
        for a, b in zip(row1, row2, strict=True)
    ]
    return (
        sum(a and not b for a, b in pairs),
        sum(a and b for a, b in pairs),
        sum(b and not a for a, b in pairs),
    )


def map_text(found: Reproduction) -> list[str]:
    """Return what the maps show, a paragraph each."""
    text = []
    for chart in found.maps:
        one, both, other = _counts(chart)
        all_cells = len(chart.gains) * len(chart.latencies)
        how = "With" if chart.compensated else "Without"
        said = (
            f"{how} delay compensation in the estimator, of {all_cells} pairs of gain and delay C1 and C2"
            f" both dock in {both}, C1 alone in {one}, C2 alone in {other}, neither in"
            f" {all_cells - one - both - other} (to dock: in at least {100 * DOCKS:.0f} % of {chart.trials}"
            " trials)."
        )
        if both:
            said += f" Both dock at {_region(chart, True, True)}."
        if one:
            said += f" C1 alone docks at {_region(chart, True, False)}."
        if other:
            said += f" C2 alone docks at {_region(chart, False, True)}."
        if not chart.compensated:
            said += f" {_where_the_paper_lies(chart)}"
        text.append(said)
    return text


def _region(chart: GainDelayMap, c1: bool, c2: bool) -> str:
    """Return at which gains and total delays these dock, adjoining gains of the same delays together."""
    spans: list[tuple[list[float], str]] = []
    for i, gain in enumerate(chart.gains):
        hit = [
            (chart.cells["c1"][i][j].success >= DOCKS, chart.cells["c2"][i][j].success >= DOCKS) == (c1, c2)
            for j in range(len(chart.latencies))
        ]
        if not any(hit):
            continue
        text = " and ".join(_delays(chart, first, last) for first, last in _runs(hit))
        if spans and spans[-1][1] == text:
            spans[-1][0].append(gain)
        else:
            spans.append(([gain], text))
    return "; ".join(f"k_n = {_between(gains)} 1/s and {text}" for gains, text in spans)


def _runs(flags: Sequence[bool]) -> list[tuple[int, int]]:
    """Return the first and the last index of every run of true flags."""
    edges = [k for k in range(len(flags) + 1) if (k > 0 and flags[k - 1]) != (k < len(flags) and flags[k])]
    return [(first, stop - 1) for first, stop in zip(edges[::2], edges[1::2], strict=True)]


def _delays(chart: GainDelayMap, first: int, last: int) -> str:
    low, high = (f"{1e3 * (chart.lag + chart.latencies[j]):.0f}" for j in (first, last))
    return f"{low} ms" if first == last else f"{low} to {high} ms"


def _between(gains: Sequence[float]) -> str:
    return f"{gains[0]:g}" if len(gains) == 1 else f"{gains[0]:g} .. {gains[-1]:g}"


def _where_the_paper_lies(chart: GainDelayMap) -> str:
    gain, latency = chart.paper_cell
    i, j = chart.gains.index(gain), chart.latencies.index(latency)
    c1, c2 = (1e3 * (chart.cells[law][i][j].final_p50_m or 0.0) for law in LAWS)
    final, total = measure("final"), latency + chart.lag
    lag_mm = 1e3 * PAPER_TRAJECTORY.speed_mps * latency
    docks = [f"{law.upper()} docks in {100 * chart.cells[law][i][j].success:.0f} %" for law in LAWS]
    return (
        f"The paper states neither gain nor delay of its comparison. Its final errors of"
        f" {1e3 * (final.paper_c1 or 0.0):g} and {1e3 * (final.paper_c2 or 0.0):g} mm are most nearly those"
        f" at k_n = {gain:g} 1/s and a total delay of {1e3 * total:.0f} ms: {c1:.0f} and {c2:.0f} mm, of"
        f" which the way driven during the latency makes {lag_mm:.0f} mm. There {' and '.join(docks)}; gain"
        f" times delay is"
        f" {gain * total:.2f}"
        f" for C1 and {(gain + chart.extra_gain) * total:.2f} for C2, whose boundary layer adds"
        f" {chart.extra_gain:g} 1/s. Tuned more gently, both dock."
    )


def hardest(found: Reproduction) -> Table | None:
    """Return the hardest table of the close phase at hand: by it the default controller is chosen."""
    return (
        found.table("close", "bullet", "hard starts")
        or found.table("close", "unicycle", "wide")
        or found.table("close", "unicycle", "hard")
    )


def winner_text(found: Reproduction) -> str:
    """Name the default controllers, the docking controller that wins, and the evidence; nothing without any.

    By docking rate, then by keeping the target in view, then by keeping it in the cone, then by the lateral
    error at contact. Those whose rates cannot be told from the winner's (their intervals overlap) are named
    with it.
    """
    table = hardest(found)
    if table is None:
        return ""
    ranked = sorted(table.rows, key=_merit, reverse=True)
    best = ranked[0]
    equal = [r for r in ranked[1:] if _alike(r, best)]
    others = [r for r in ranked[1:] if r not in equal]
    shipped = ControlSpec()
    default = _row(table, shipped.docking.name.upper())
    text = (
        f"The default docking controller is {shipped.docking.name.upper()}, the default of the long-distance"
        f" phase {shipped.assembly.name.upper()}. The evidence ({table.plant}, {best.trials} trials;"
        f" {table.description}): {best.label} wins by docking rate, then by keeping the target in view, then"
        f" by keeping it in the cone, then by the lateral error at contact ({_credentials(best)})."
    )
    if default is not None and default is not best:
        place = "cannot be told from it" if default in equal else "is behind it"
        text += f" The default {place}."
    if equal:
        text += f" Its rates cannot be told from those of {_listed(equal)}."
    if others:
        text += f" Behind it: {'; '.join(f'{r.label} ({_credentials(r, brief=True)})' for r in others)}."
    return text


def _listed(rows: Sequence[Row]) -> str:
    return "; ".join(f"{r.label} ({_credentials(r)})" for r in rows)


def _merit(row: Row) -> tuple[float, float, float, float]:
    lateral = row.measures["lateral"].quantiles.p95 if "lateral" in row.measures else None
    off = lateral if lateral is not None else float("inf")
    return (row.success.rate, _known(row.in_view).rate, _known(row.in_cone).rate, -off)


def _alike(row: Row, best: Row) -> bool:
    pairs = ((row.success, best.success), (row.in_view, best.in_view), (row.in_cone, best.in_cone))
    return all(_known(a).high >= _known(b).low for a, b in pairs)


def _known(rate: Rate | None) -> Rate:
    return rate if rate is not None else Rate(rate=0.0, low=0.0, high=0.0)


def _credentials(row: Row, brief: bool = False) -> str:
    """Return rates, with their intervals unless ``brief``, and the lateral error at contact."""
    rates = ((row.success, "docked"), (row.in_view, "in view"), (row.in_cone, "in the cone"))
    said = [
        f"{f'{100 * rate.rate:.1f} %' if brief else percent(rate)} {what}"
        for rate, what in rates
        if rate is not None
    ]
    lateral = row.measures["lateral"].quantiles.p95 if "lateral" in row.measures else None
    if lateral is not None:
        said.append(f"{1e3 * lateral:.2g} mm" if brief else f"{1e3 * lateral:.2g} mm off at contact in 95 %")
    return ", ".join(said)


def percent(rate: Rate) -> str:
    """Return a rate with its interval."""
    return f"{100 * rate.rate:.1f} % ({100 * rate.low:.1f} .. {100 * rate.high:.1f})"
