"""Numbers and findings of a tolerance study as they are written on the console and on the page."""

from __future__ import annotations

from collections.abc import Sequence

from msrr_bullet.statistics import Quantiles, Rate
from msrr_bullet.tolerance.error_budget import Contribution, predicted
from msrr_bullet.tolerance.model import EffectResult, GradeSample, Sample, SizeSample, Slope, ToleranceStudy
from msrr_bullet.tolerance.trial_plan import REQUIRED

NONE = "-"

#: Cell of an effect with which docking stays at 95 % and more up to the largest size that was tried.
NO_LIMIT = "no limit found"

#: Smallest share that is written as a number.
_LEAST_SHARE = 0.0005


def number(value: float) -> str:
    """Return a number with three digits that count."""
    return f"{value:.3g}"


def with_unit(value: float, effect: EffectResult) -> str:
    """Return a size of an effect with its unit."""
    return f"{number(value)} {effect.unit}".rstrip()


def listed(seeds: Sequence[int]) -> str:
    """Return seeds as the first and the last one if all between are among them, else one by one."""
    if len(seeds) > 1 and list(seeds) == list(range(seeds[0], seeds[-1] + 1)):
        return f"{seeds[0]} to {seeds[-1]}"
    return ", ".join(map(str, seeds))


def percent(share: float) -> str:
    """Return a share in percent."""
    if 0.0 < share < _LEAST_SHARE:
        return "below 0.1 %"
    return f"{100 * share:.1f} %" if _LEAST_SHARE <= share < 0.0995 else f"{100 * share:.0f} %"


def interval(rate: Rate) -> str:
    """Return the 95 % interval of a rate."""
    return f"{100 * rate.low:.0f} .. {100 * rate.high:.0f} %"


def docked_count(sample: Sample) -> str:
    """Return how many trials docked."""
    return f"{sample.successes} of {len(sample.trials)}"


def median_and_95(values: Quantiles) -> str:
    """Return median and 95th percentile."""
    if values.p50 is None or values.p95 is None:
        return NONE
    return f"{values.p50:.2f} / {values.p95:.2f}"


def outcomes(sample: Sample) -> str:
    """Return the outcomes of trials with their numbers."""
    return ", ".join(f"{count} {name}" for name, count in sample.outcomes.items())


def limit(effect: EffectResult) -> str:
    """Return between which sizes docking falls below 95 %."""
    if effect.fails is None:
        return f"above {with_unit(effect.top, effect)}"
    if effect.holds == 0.0:
        return f"below {with_unit(effect.fails, effect)}"
    return f"{number(effect.holds)} .. {with_unit(effect.fails, effect)}"


def at_limit(effect: EffectResult) -> list[tuple[str, SizeSample]]:
    """Return the trials on both sides of the limit, each with its size in words."""
    sizes = [size for size in (effect.holds, effect.fails) if size]
    return [(with_unit(size, effect), effect.sample(size)) for size in sizes]


def beyond(effect: EffectResult) -> str:
    """Return how the trials end at the size that is too large, and with which sign if it is only one."""
    if effect.fails is None:
        return ""
    sample = effect.sample(effect.fails)
    failed, docked = (
        {(t.error or 0.0) > 0.0 for t in sample.trials if t.succeeded is s} for s in (False, True)
    )
    if effect.both_signs and len(failed) == 1 and not failed & docked:
        return f"{outcomes(sample)}, only with {'+' if True in failed else '-'}"
    return outcomes(sample)


def slope(value: Slope | None) -> str:
    """Return a slope with its interval."""
    if value is None:
        return NONE
    return f"{number(value.rms)} ({number(value.low)} .. {number(value.high)})"


def systematic(value: Slope | None) -> str:
    """Return the part of a slope that is the same in every trial, with its sign."""
    if value is None or value.systematic is None:
        return NONE
    return f"{value.systematic:+z.3g}"


def grade_cells(sample: GradeSample, found: Sequence[Contribution], all_graded: bool) -> list[str]:
    """Return the cells of a grade in the table of grades, of which :data:`GRADE_COLUMNS` are the heads.

    Without all effects of the grades there is nothing to say of what the parts predict.
    """
    docked, lateral_mm = predicted(found, sample.grade)
    rms = NONE if sample.lateral_rms_mm is None else f"{sample.lateral_rms_mm:.2f}"
    return [
        sample.grade,
        docked_count(sample),
        interval(sample.docked),
        median_and_95(sample.lateral_mm),
        median_and_95(sample.yaw_deg),
        f"{rms} ({lateral_mm:.2f})" if all_graded else rms,
        f"{100 * docked:.0f} %" if all_graded else NONE,
        outcomes(sample),
    ]


GRADE_COLUMNS = (
    "grade",
    "docked",
    "95 % interval",
    "lateral error at contact [mm], median / 95 %",
    "yaw error at contact [deg], median / 95 %",
    "lateral RMS [mm] (by the parts)",
    "docked by the parts",
    "outcomes",
)

FIRST_COLUMNS = (
    "build more precisely",
    "1 sigma of careful",
    "docks to, and no longer",
    "share of what is used up",
    "adds to the lateral error [mm]",
    "share of its square",
)

EFFECT_COLUMNS = (
    "effect",
    "docks to, and no longer",
    "docked there",
    "lateral and yaw error at contact, median / 95 %",
    "lateral error [mm] per unit of the effect",
    "of it to one side",
    "yaw error [deg] per unit of the effect",
    "how the trials beyond end",
)


def first_cells(contribution: Contribution) -> list[str]:
    """Return the cells of an effect in the table of what to build first; see :data:`FIRST_COLUMNS`.

    What was not found is no zero: an effect may have a limit beyond the largest size that was tried, and
    without a contact there is no lateral error.
    """
    effect = contribution.effect
    measured = effect.lateral is not None
    return [
        effect.name,
        with_unit(effect.step, effect),
        limit(effect),
        NO_LIMIT if effect.threshold is None else percent(contribution.used_share),
        NONE if effect.lateral is None else lateral_cell(contribution.lateral_mm, effect.lateral),
        percent(contribution.lateral_share) if measured else NONE,
    ]


def lateral_cell(lateral_mm: float, slope: Slope) -> str:
    """Return what an effect adds to the lateral error, and whether that may be chance."""
    return f"{lateral_mm:.2f}{'' if slope.low > 0.0 else ', may be chance'}"


def chance(study: ToleranceStudy) -> str:
    """Return in a sentence what chance does to the errors at contact."""
    lateral, yaw = slope(study.chance_lateral), slope(study.chance_yaw)
    return (
        f"Chance changes the lateral error at contact by {lateral} mm and the yaw error by {yaw} deg, "
        "measured by an error that is too small to matter, for the course of a trial depends on each pixel. "
        "The squares of this are taken off those of all slopes, with the most that it may be off the lower "
        "bound and the least off the upper one."
    )


def findings(study: ToleranceStudy, found: Sequence[Contribution]) -> list[str]:
    """Return what a study has found, in sentences."""
    said = []
    if study.drawn.docked.rate < REQUIRED:
        said.append(
            f"Without any effect only {docked_count(study.drawn)} trials docked, "
            "so that no size of any holds."
        )
    for sample in study.grades:
        if sample.grade == "careful":
            p95 = sample.lateral_mm.p95
            error = "" if p95 is None else f", with a lateral error at contact of {p95:.2f} mm in 95 %"
            said.append(
                f"With everything built by the grade careful {docked_count(sample)} trials docked"
                f" ({interval(sample.docked)}){error}."
            )
    if not study.all_graded:
        said.append(
            "Not all effects that the grades have were tried: shares are those in what the tried ones add up"
            " to, and nothing is predicted for a grade."
        )
    tried = "" if study.all_graded else "Of the effects tried, "
    for title, shares in (
        (
            f"{tried}the largest shares in what is used up of docking's tolerance have",
            [c.used_share for c in found],
        ),
        (f"{tried}the largest shares in the squared lateral error have", [c.lateral_share for c in found]),
    ):
        largest = sorted(zip(shares, found, strict=True), key=lambda pair: pair[0], reverse=True)[:4]
        listed = [f"{c.effect.name} ({percent(share)})" for share, c in largest if share > 0.0]
        if listed:
            said.append(f"{title[0].upper()}{title[1:]} {', '.join(listed)}.")
    harmless = [e for e in study.effects if e.fails is None]
    if harmless:
        said.append(
            f"{len(harmless)} of {len(study.effects)} effects keep no unit from docking at any size that was"
            " tried."
        )
    return said
