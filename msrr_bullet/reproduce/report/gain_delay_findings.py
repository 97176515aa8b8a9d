"""The findings of the maps over gain and delay in words; every number is read from the results."""

from __future__ import annotations

from collections.abc import Sequence

from msrr_bullet.studies.gain_delay import LAWS
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import GainDelayMap, Reproduction
from msrr_bullet.studies.settings import PAPER_TRAJECTORY

#: Share of trials from which on a cell of the map counts as docking.
DOCKS = 0.95


def count_cells(chart: GainDelayMap) -> tuple[int, int, int]:
    """Return the number of cells in which C1 alone, both laws, and C2 alone dock."""
    pairs = [
        (c1.success >= DOCKS, c2.success >= DOCKS)
        for c1_row, c2_row in zip(chart.cells["c1"], chart.cells["c2"], strict=True)
        for c1, c2 in zip(c1_row, c2_row, strict=True)
    ]
    return pairs.count((True, False)), pairs.count((True, True)), pairs.count((False, True))


def map_text(results: Reproduction) -> list[str]:
    """Describe the maps, a paragraph each."""
    return [_map_paragraph(chart) for chart in results.maps]


def _map_paragraph(chart: GainDelayMap) -> str:
    c1_alone, both, c2_alone = count_cells(chart)
    cells = len(chart.gains) * len(chart.latencies)
    text = (
        f"{'With' if chart.compensated else 'Without'} delay compensation in the estimator, of {cells} pairs"
        f" of gain and delay C1 and C2 both dock in {both}, C1 alone in {c1_alone}, C2 alone in {c2_alone},"
        f" neither in {cells - c1_alone - both - c2_alone} (to dock: in at least {100 * DOCKS:.0f} % of"
        f" {chart.trials} trials)."
    )
    if both:
        text += f" Both dock at {_region(chart, True, True)}."
    if c1_alone:
        text += f" C1 alone docks at {_region(chart, True, False)}."
    if c2_alone:
        text += f" C2 alone docks at {_region(chart, False, True)}."
    return text if chart.compensated else f"{text} {_paper_sentences(chart)}"


def _region(chart: GainDelayMap, c1: bool, c2: bool) -> str:
    """Return the gains and total delays at which these laws dock; gains with equal delays are joined."""
    spans: list[tuple[list[float], str]] = []
    for i, gain in enumerate(chart.gains):
        inside = [
            (chart.cells["c1"][i][j].success >= DOCKS, chart.cells["c2"][i][j].success >= DOCKS) == (c1, c2)
            for j in range(len(chart.latencies))
        ]
        if not any(inside):
            continue
        text = " and ".join(_delays(chart, first, last) for first, last in _runs(inside))
        if spans and spans[-1][1] == text:
            spans[-1][0].append(gain)
        else:
            spans.append(([gain], text))
    return "; ".join(f"k_n = {_span(gains)} 1/s and {text}" for gains, text in spans)


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
    c1_mm, c2_mm = (1e3 * (chart.cells[law][i][j].final_p50_m or 0.0) for law in LAWS)
    final, delay = measure("final"), latency + chart.lag
    latency_mm = 1e3 * PAPER_TRAJECTORY.speed_mps * latency
    docks = [f"{law.upper()} docks in {100 * chart.cells[law][i][j].success:.0f} %" for law in LAWS]
    return (
        "The paper states neither gain nor delay of its comparison. Its final errors of"
        f" {1e3 * (final.paper_c1 or 0.0):g} and {1e3 * (final.paper_c2 or 0.0):g} mm are most nearly those"
        f" at k_n = {gain:g} 1/s and a total delay of {1e3 * delay:.0f} ms: {c1_mm:.0f} and {c2_mm:.0f} mm,"
        f" of which the distance driven during the latency makes {latency_mm:.0f} mm. There"
        f" {' and '.join(docks)}; gain times delay is {gain * delay:.2f} for C1 and"
        f" {(gain + chart.extra_gain) * delay:.2f} for C2, whose boundary layer adds"
        f" {chart.extra_gain:g} 1/s. At lower gains both dock."
    )
