"""The docking laws ranked over the settings that are hard for them, and the default that this names."""

from __future__ import annotations

from typing import NamedTuple, get_args

import numpy as np

from msrr_bullet.paired import mcnemar, paired_difference
from msrr_bullet.reproduce.report.comparisons import LEVEL, format_interval, shared_values
from msrr_bullet.reproduce.report.formatting import format_quantiles, format_rate
from msrr_bullet.statistics import Rate
from msrr_bullet.studies.labels import label_of
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import FlagName, Reproduction, Row, Table
from msrr_scenes.specs.control import ControlSpec
from msrr_scenes.wording import counted

#: Plant and setting of the tables by which the laws are ranked: wide and hard starts under tight limits at
#: 100 ms, with delay compensation and without.
_RANKED = (
    ("unicycle", "wide"),
    ("unicycle", "wide, uncompensated"),
    ("bullet", "hard starts"),
    ("bullet", "hard starts, uncompensated"),
)

#: Measures that the ranking shows.
_SHOWN = ("contact", "lateral", "yaw")

#: The columns of :func:`ranking`; the last one says what differs from the default beyond chance.
COLUMNS = (
    "setting",
    "law",
    "docked",
    "kept in the cone",
    *(f"{measure(key).label} [{measure(key).unit}]" for key in _SHOWN),
    "beside the default",
)


class _Law(NamedTuple):
    """A law and its rows in the tables of the ranking."""

    label: str
    rows: tuple[Row, ...]

    def worst(self, name: FlagName) -> Rate:
        """Return the lowest of a law's rates; 0 for one that is not known."""
        # A row has a field of the name of each flag.
        rates = [getattr(row, name) or Rate(rate=0.0, low=0.0, high=0.0) for row in self.rows]
        return min(rates, key=lambda rate: (rate.rate, rate.low))

    @property
    def lateral(self) -> float:
        """The largest 95th percentile of the lateral error at contact [m]; infinite without a contact."""
        found = [row.measures["lateral"].quantiles.p95 for row in self.rows if "lateral" in row.measures]
        return max((np.inf if p95 is None else p95 for p95 in found), default=np.inf)

    @property
    def rank(self) -> tuple[float, ...]:
        """The key of the ranking, the larger the better."""
        return (*(self.worst(name).rate for name in get_args(FlagName)), -self.lateral)

    def evidence(self, brief: bool = False) -> str:
        """Return the lowest rates, with their intervals unless ``brief``, and the lateral error."""
        names = {"success": "docked", "in_view": "in view", "in_cone": "in the cone"}
        parts = []
        for name in get_args(FlagName):
            rate = self.worst(name)
            parts.append(f"{f'{100 * rate.rate:.1f} %' if brief else format_rate(rate)} {names[name]}")
        error = f"{1e3 * self.lateral:.2g} mm"
        return ", ".join([*parts, error if brief else f"{error} off at contact in 95 %"])


def default_controller_text(results: Reproduction) -> str:
    """Name the default controllers, the best docking controller, and the evidence; empty without a table.

    Docking controllers are ranked by what they do in the setting that is worst for them: by docking rate,
    then by keeping the target in view, then by keeping it in the cone, then by the lateral error at contact.
    Controllers whose rates cannot be told from the best one's on the same trials of any setting are named
    with it.
    """
    tables = _tables(results)
    if not tables:
        return ""
    best, *others = sorted(_laws(tables), key=lambda law: law.rank, reverse=True)
    equal = [law for law in others if _rates_are_equal(law, best)]
    worse = [law for law in others if law not in equal]
    shipped = ControlSpec()
    default = label_of(shipped.docking.name)
    settings = "; ".join(f"{t.plant}, {counted(t.rows[0].trials, 'trial')}: {t.description}" for t in tables)
    text = (
        f"The default docking controller is {default}, the default of the long-distance phase"
        f" {label_of(shipped.assembly.name)}. The evidence ({settings}): {best.label} is the best by docking"
        " rate, then by keeping the target in view, then by keeping it in the cone, then by the lateral error"
        f" at contact, each in the setting that is worst for it ({best.evidence()})."
    )
    if default != best.label:
        alike = default in [law.label for law in equal]
        text += f" The default {'cannot be told from it' if alike else 'is worse'}."
    if equal:
        listed = "; ".join(f"{law.label} ({law.evidence()})" for law in equal)
        text += f" The rates of {best.label} cannot be told from those of {listed}."
    if worse:
        listed = "; ".join(f"{law.label} ({law.evidence(brief=True)})" for law in worse)
        text += f" Worse are {listed}."
    return text


def ranking(results: Reproduction) -> list[tuple[str, ...]]:
    """Return a row of :data:`COLUMNS` for each law in each setting, the best law first."""
    tables = _tables(results)
    laws = sorted(_laws(tables), key=lambda law: law.rank, reverse=True)
    default = label_of(ControlSpec().docking.name)
    found = []
    for i, table in enumerate(tables):
        for law in laws:
            row, base = law.rows[i], table.row(default)
            found.append(
                (
                    f"{table.plant}, {table.setting}",
                    law.label,
                    format_rate(row.success),
                    format_rate(row.in_cone) if row.in_cone is not None else "-",
                    *(format_quantiles(row, measure(key)) for key in _SHOWN),
                    "-" if base is None or base is row else _beside(base, row) or "nothing beyond chance",
                )
            )
    return found


def ranking_text(results: Reproduction) -> str:
    """Return the ranking as a table in Markdown; empty without one."""
    lines = ["| " + " | ".join(row) + " |" for row in (COLUMNS, *ranking(results))]
    rule = "|" + "---|" * len(COLUMNS)
    return "\n".join([lines[0], rule, *lines[1:]]) if len(lines) > 1 else ""


def _tables(results: Reproduction) -> list[Table]:
    """Return the tables of the ranking, or if there is none of these the hard starts on unicycles."""
    named = [results.table("close", plant, setting) for plant, setting in _RANKED]
    found = [table for table in named if table is not None]
    hard = results.table("close", "unicycle", "hard")
    return found or ([hard] if hard is not None else [])


def _laws(tables: list[Table]) -> list[_Law]:
    """Return the laws as they ship that every table has."""
    labels = [row.label for row in tables[0].rows if not row.label.endswith(", tuned")] if tables else []
    rows = {label: [table.row(label) for table in tables] for label in labels}
    return [
        _Law(label, tuple(row for row in found if row is not None))
        for label, found in rows.items()
        if None not in found
    ]


def _rates_are_equal(law: _Law, best: _Law) -> bool:
    """Return whether no rate of a law is lower than that of the best one beyond chance, trial by trial.

    The level is that of all its rates together, by Bonferroni's correction.
    """
    flags = [
        (row.by_trial(name), other.by_trial(name))
        for row, other in zip(law.rows, best.rows, strict=True)
        for name in get_args(FlagName)
    ]
    pairs = [mcnemar(a, b) for a, b in flags if a is not None and b is not None]
    return not any(pair.second_alone > pair.first_alone and len(pairs) * pair.p < LEVEL for pair in pairs)


def _beside(base: Row, row: Row) -> str:
    """Return in which figures a law differs from the default beyond chance, and which have too few trials."""
    parts, too_few = [], []
    figures: dict[FlagName, str] = {"success": "docked", "in_cone": "cone"}
    for name, figure in figures.items():
        a, b = base.by_trial(name), row.by_trial(name)
        if a is not None and b is not None:
            lost, won, p = mcnemar(a, b)
            if p < LEVEL:
                parts.append(f"{figure}: {lost} lost, {won} won")
    for key in _SHOWN:
        shown = measure(key)
        ours, theirs = shared_values(shown, base, row)
        difference = paired_difference(theirs, ours, shown.tail) if ours.size else None
        quantity = shown.label.split()[0]
        if difference is None or difference.interval is None:
            too_few.append(quantity)
        elif difference.is_apart:
            parts.append(f"{quantity} {format_interval(difference.interval, shown)} {shown.unit}")
    if too_few:
        parts.append(f"too few trials: {', '.join(too_few)}")
    return "; ".join(parts)
