"""The findings of the maps over gain and delay in words; every number is read from the results."""

from __future__ import annotations

from collections.abc import Sequence

from msrr_bullet.studies.gain_delay import C1, LAWS
from msrr_bullet.studies.labels import C2
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import GainDelayMap
from msrr_bullet.studies.settings import PAPER_TRAJECTORY

#: Share of trials from which on a cell of the map counts as docking.
DOCKS = 0.95


def count_cells(chart: GainDelayMap, first: str, second: str) -> tuple[int, int, int]:
    """Return the number of cells in which the first of two laws alone, both, and the second alone dock."""
    pairs = [
        (a.success >= DOCKS, b.success >= DOCKS)
        for a_row, b_row in zip(chart.cells[first], chart.cells[second], strict=True)
        for a, b in zip(a_row, b_row, strict=True)
    ]
    return pairs.count((True, False)), pairs.count((True, True)), pairs.count((False, True))


def map_text(chart: GainDelayMap) -> str:
    """Describe a map in a paragraph."""
    c1_alone, both, c2_alone = count_cells(chart, C1, C2)
    cells = len(chart.gains) * len(chart.latencies)
    text = (
        f"{'With' if chart.compensated else 'Without'} delay compensation in the estimator, of {cells} pairs"
        f" of gain and delay C1 and {C2} both dock in {both}, C1 alone in {c1_alone}, {C2} alone in"
        f" {c2_alone}, neither in {cells - c1_alone - both - c2_alone} (to dock: in at least"
        f" {100 * DOCKS:.0f} % of {chart.trials} trials)."
    )
    if both:
        text += f" Both dock at {region(chart, C1, C2, (True, True))}."
    if c1_alone:
        text += f" C1 alone docks at {region(chart, C1, C2, (True, False))}."
    if c2_alone:
        text += f" {C2} alone docks at {region(chart, C1, C2, (False, True))}."
    docking = [f"{label} in {sum(count_cells(chart, label, label))}" for label in LAWS]
    text += f" With and without anti-windup, docking: {', '.join(docking[:-1])} and {docking[-1]}."
    return text if chart.compensated else f"{text} {_paper_sentences(chart)}"


def region(chart: GainDelayMap, first: str, second: str, who: tuple[bool, bool]) -> str:
    """Return the gains and total delays at which these of two laws dock; gains of equal delays are joined."""
    spans: list[tuple[list[float], str]] = []
    for i, gain in enumerate(chart.gains):
        inside = [
            tuple(chart.cells[law][i][j].success >= DOCKS for law in (first, second)) == who
            for j in range(len(chart.latencies))
        ]
        if not any(inside):
            continue
        text = " and ".join(_delays(chart, begin, last) for begin, last in _runs(inside))
        if spans and spans[-1][1] == text:
            spans[-1][0].append(gain)
        else:
            spans.append(([gain], text))
    return "; ".join(f"k_n = {_span(gains)} 1/s and {text}" for gains, text in spans)


def _gentle_sentence(chart: GainDelayMap) -> str:
    """Name the gains at which both laws dock at every delay, if there are any."""
    gentle = [
        gain
        for i, gain in enumerate(chart.gains)
        if all(cell.success >= DOCKS for law in (C1, C2) for cell in chart.cells[law][i])
    ]
    listed = ", ".join(f"{gain:g}" for gain in gentle)
    return f" At k_n = {listed} 1/s both dock at every delay." if gentle else ""


def _runs(flags: Sequence[bool]) -> list[tuple[int, int]]:
    """Return the first and the last index of every run of true flags."""
    edges = [k for k in range(len(flags) + 1) if (k > 0 and flags[k - 1]) != (k < len(flags) and flags[k])]
    return [(first, stop - 1) for first, stop in zip(edges[::2], edges[1::2], strict=True)]


def _delays(chart: GainDelayMap, first: int, last: int) -> str:
    low, high = (f"{1e3 * (chart.lag + chart.latencies[j]):.0f}" for j in (first, last))
    return f"{low} ms" if first == last else f"{low} to {high} ms"


def _span(gains: Sequence[float]) -> str:
    return f"{gains[0]:g}" if len(gains) == 1 else f"{gains[0]:g} .. {gains[-1]:g}"


def _paper_sentences(chart: GainDelayMap) -> str:
    """Return where on the map the paper's two final errors are most nearly found."""
    gain, latency = chart.paper_cell
    i, j = chart.gains.index(gain), chart.latencies.index(latency)
    c1_mm, c2_mm = (1e3 * chart.cells[law][i][j].final_p50_m for law in (C1, C2))
    final, delay = measure("final"), latency + chart.lag
    latency_mm = 1e3 * PAPER_TRAJECTORY.speed_mps * latency
    docks = [f"{law} docks in {100 * chart.cells[law][i][j].success:.0f} %" for law in (C1, C2)]
    return (
        "The paper states neither gain nor delay of its comparison. Its final errors of"
        f" {1e3 * (final.paper_c1 or 0.0):g} and {1e3 * (final.paper_c2 or 0.0):g} mm are most nearly those"
        f" at k_n = {gain:g} 1/s and a total delay of {1e3 * delay:.0f} ms: {c1_mm:.0f} and {c2_mm:.0f} mm,"
        f" of which the distance driven during the latency makes {latency_mm:.0f} mm. There"
        f" {' and '.join(docks)}; gain times delay is {gain * delay:.2f} for C1 and"
        f" {(gain + chart.extra_gain) * delay:.2f} for {C2}, whose boundary layer adds"
        f" {chart.extra_gain:g} 1/s.{_gentle_sentence(chart)}"
    )
