"""What a reproduction says, in words and against what is asked; every number is read from the findings."""

from __future__ import annotations

from dataclasses import dataclass

from msrr_bullet.reproduce.gain_delay import LAWS
from msrr_bullet.reproduce.measures import MEASURES, PhaseName, measure
from msrr_bullet.reproduce.model import Ablations, GainDelayMap, Reproduction, Row, Table
from msrr_bullet.reproduce.settings import PAPER_TRAJECTORY
from msrr_bullet.stats import Rate

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
                    f"{s * p50:.3g} / {s * p95:.3g} {unit}",
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
    mission = found.table("close", "bullet", "whole mission")
    row = _row(mission, "C1")
    if row is not None and row.within_paper is not None:
        text = f"{row.within_paper} of {row.trials}"
        enough = row.within_paper >= 0.95 * row.trials
        said.append(Claim("C1, whole mission, images: every figure of the paper in 95 %", text, enough))
    hard = found.table("close", "bullet", "hard starts")
    row = _row(hard, "CBF")
    if row is not None and row.in_view is not None:
        text = f"{100 * row.in_view.rate:.0f} % kept in view, {100 * row.success.rate:.0f} % docked"
        enough = row.in_view.rate == 1.0 and row.success.rate >= 0.97
        said.append(
            Claim("CBF, hard starts, images: target kept in view in all, docked in 97 %", text, enough)
        )
    return said


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


def map_text(found: Reproduction) -> str:
    """Return what the maps show."""
    text = []
    for chart in found.maps:
        one, both, other = _counts(chart)
        all_cells = len(chart.gains) * len(chart.latencies)
        how = "With" if chart.compensated else "Without"
        text.append(
            f"{how} delay compensation in the estimator, of {all_cells} pairs of gain and delay C1 and C2"
            f" both dock in {both}, C1 alone in {one}, C2 alone in {other}."
        )
        if not chart.compensated:
            text.append(_where_the_paper_lies(chart))
    return " ".join(text)


def _where_the_paper_lies(chart: GainDelayMap) -> str:
    gain, latency = chart.paper_cell
    i, j = chart.gains.index(gain), chart.latencies.index(latency)
    c1, c2 = (1e3 * (chart.cells[law][i][j].final_p50_m or 0.0) for law in LAWS)
    final, total = measure("final"), latency + chart.lag
    lag_mm = 1e3 * PAPER_TRAJECTORY.speed_mps * latency
    return (
        f"The paper states neither gain nor delay of its comparison. Its final errors of"
        f" {1e3 * (final.paper_c1 or 0.0):g} and {1e3 * (final.paper_c2 or 0.0):g} mm are most nearly those"
        f" at k_n = {gain:g} 1/s and a total delay of {1e3 * total:.0f} ms: {c1:.0f} and {c2:.0f} mm, of"
        f" which the way driven during the latency makes {lag_mm:.0f} mm. There gain times delay is"
        f" {gain * total:.2f}"
        f" for C1 and {(gain + chart.extra_gain) * total:.2f} for C2, whose boundary layer adds"
        f" {chart.extra_gain:g} 1/s. Tuned more gently, both dock."
    )


def ablation_text(found: Ablations) -> str:
    """Say what C1 loses without each of its parts, in the setting in which it loses most."""
    text = []
    for k, variant in enumerate(found.tables[0].rows):
        if k == 0:
            continue
        costs = []
        for what, losses in _losses(found, k).items():
            most, setting = max(losses)
            if most >= 0.02:
                costs.append(f"{100 * most:.0f} points of {what} ({setting})")
        raised, label, setting = max(_raises(found, k))
        if raised >= 1.1:
            costs.append(f"{raised:.1f} times the 95th percentile of the {label} ({setting})")
        nearer, setting = _clearance_lost(found, k)
        if nearer >= 0.005:
            costs.append(f"{1e3 * nearer:.0f} mm of the median clearance ({setting})")
        name = variant.label[0].upper() + variant.label[1:]
        text.append(f"{name}: {'; '.join(costs) if costs else 'nothing to speak of'}.")
    return f"What C1 loses at worst. {' '.join(text)}"


def _clearance_lost(found: Ablations, k: int) -> tuple[float, str]:
    """Return by how much the median clearance of variant ``k`` is less at most than that of C1, and where."""
    lost = [(0.0, "")]
    for table in found.tables:
        whole, without = (table.rows[i].measures.get("clearance") for i in (0, k))
        if whole is None or without is None or without.quantiles.p50 is None or without.quantiles.p50 <= 0.0:
            continue  # one that drives through the obstacle fails; that is said already
        lost.append(((whole.quantiles.p50 or 0.0) - without.quantiles.p50, table.setting))
    return max(lost)


def _losses(found: Ablations, k: int) -> dict[str, list[tuple[float, str]]]:
    """Return by how much variant ``k`` is worse than C1 in each setting, for each rate."""
    good = "docking" if found.phase == "close" else "passing the obstacle"
    losses = {good: [(t.rows[0].success.rate - t.rows[k].success.rate, t.setting) for t in found.tables]}
    for table in found.tables:
        whole, without = table.rows[0].in_view, table.rows[k].in_view
        if whole is not None and without is not None:
            losses.setdefault("keeping the target in view", []).append(
                (whole.rate - without.rate, table.setting)
            )
    return losses


def _raises(found: Ablations, k: int) -> list[tuple[float, str, str]]:
    """Return the ratios of the 95th percentiles of variant ``k`` to those of C1, with measure and setting."""
    ratios = []
    for table in found.tables:
        for what in MEASURES[found.phase]:
            whole, without = (table.rows[i].measures[what.key].quantiles.p95 for i in (0, k))
            if what.paper_c1 is not None and whole and without is not None:
                ratios.append((without / whole, what.label, table.setting))
    return ratios


def winner_text(found: Reproduction) -> str:
    """Name the docking controller that wins, by the hardest table at hand; nothing without one.

    By docking rate, then by keeping the target in view, then by the lateral error at contact. Those whose two
    rates cannot be told from the winner's (their intervals overlap) are named with it.
    """
    table = (
        found.table("close", "bullet", "hard starts")
        or found.table("close", "unicycle", "wide")
        or found.table("close", "unicycle", "hard")
    )
    if table is None:
        return ""
    ranked = sorted(table.rows, key=_merit, reverse=True)
    best = ranked[0]
    equal = [r for r in ranked[1:] if _alike(r, best)]
    others = [r for r in ranked[1:] if r not in equal]
    text = (
        f"{table.description} ({table.plant}, {best.trials} trials): {best.label} wins by docking rate, then"
        f" by keeping the target in view, then by the lateral error at contact ({_credentials(best)})."
    )
    if equal:
        text += f" Its rates cannot be told from those of {'; '.join(map(_credentials, equal))}."
    if others:
        text += f" Behind it: {'; '.join(map(_credentials, others))}."
    return text


def _merit(row: Row) -> tuple[float, float, float]:
    lateral = row.measures["lateral"].quantiles.p95 if "lateral" in row.measures else None
    return (row.success.rate, _view(row).rate, -(lateral if lateral is not None else float("inf")))


def _alike(row: Row, best: Row) -> bool:
    return row.success.high >= best.success.low and _view(row).high >= _view(best).low


def _view(row: Row) -> Rate:
    return row.in_view if row.in_view is not None else Rate(rate=0.0, low=0.0, high=0.0)


def _credentials(row: Row) -> str:
    lateral = row.measures["lateral"].quantiles.p95 if "lateral" in row.measures else None
    off = "" if lateral is None else f", {1e3 * lateral:.2g} mm"
    return f"{row.label} {100 * row.success.rate:.1f} % docked, {100 * _view(row).rate:.1f} % in view{off}"
