"""The error budget of a grade: what each effect contributes to it by the trials in which it was alone."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from msrr_bullet.tolerance.model import EffectResult, ToleranceStudy
from msrr_scenes.specs.as_built import GRADES, Grade

#: Docks lost by an effect below which the lateral error decides what to build more precisely first.
_NEGLIGIBLE = 0.001


@dataclass(frozen=True, slots=True)
class Contribution:
    """What one effect alone contributes.

    Attributes:
        effect: The effect.
        lateral_mm: Lateral error at contact that it adds at the size of comparison, root mean square [mm];
            0 without a contact.
        share: Share of it in the squared errors of all effects of the grade ``careful``.
        lost: Share of the trials that do not dock because of it, by grade.
    """

    effect: EffectResult
    lateral_mm: float
    share: float
    lost: dict[Grade, float]


def contributions(study: ToleranceStudy) -> list[Contribution]:
    """Return the contributions of the effects that the grades have, the first to be reduced first.

    That is the one that loses most docks at ``careful``; among those that lose next to none it is the one
    with the largest share in the lateral error.
    """
    graded = [effect for effect in study.effects if effect.graded]
    total = sum(_lateral_mm(effect) ** 2 for effect in graded)
    found = [
        Contribution(
            effect=effect,
            lateral_mm=_lateral_mm(effect),
            share=_lateral_mm(effect) ** 2 / total if total else 0.0,
            lost={grade: lost(effect, factor * effect.step) for grade, factor in GRADES.items()},
        )
        for effect in graded
    ]
    return sorted(found, key=_urgency, reverse=True)


def _urgency(contribution: Contribution) -> tuple[float, float]:
    loses = contribution.lost["careful"]
    return (loses if loses >= _NEGLIGIBLE else 0.0, contribution.share)


def _lateral_mm(effect: EffectResult) -> float:
    return effect.lateral.rms * effect.step if effect.lateral is not None else 0.0


def lost(effect: EffectResult, sigma: float) -> float:
    """Return the share of trials that an effect loses when its error is normal with this standard deviation.

    Every trial with an error beyond the threshold counts as lost, every other one as docked. Of an effect
    whose size is a standard deviation itself, one trial in twenty counts as lost beyond the threshold.
    """
    threshold = effect.threshold
    if sigma == 0.0 or threshold is None:
        return 0.0
    if effect.drawn:
        return 0.05 if sigma >= threshold else 0.0
    return 2.0 * NormalDist().cdf(-threshold / sigma)


def predicted(found: Iterable[Contribution], grade: Grade) -> tuple[float, float]:
    """Return what the effects, each measured alone, predict for a grade if they are independent.

    Returns:
        Share of the trials that dock, and root mean square of the lateral error at contact [mm].
    """
    listed = list(found)
    docked = float(np.prod([1.0 - contribution.lost[grade] for contribution in listed]))
    return docked, GRADES[grade] * math.hypot(*(contribution.lateral_mm for contribution in listed))
