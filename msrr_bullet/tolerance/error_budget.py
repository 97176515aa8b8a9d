"""The error budget of a grade: what each effect contributes to it by the trials in which it was alone."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from statistics import NormalDist

from msrr_bullet.tolerance.model import EffectResult, ToleranceStudy
from msrr_scenes.specs.as_built import GRADES, Grade

#: Standard deviations beyond which one of twenty normal errors lies.
_ONE_IN_TWENTY = -NormalDist().inv_cdf(0.025)


@dataclass(frozen=True, slots=True)
class Contribution:
    """What one effect alone contributes to the grade ``careful``.

    Attributes:
        effect: The effect.
        lateral_mm: Lateral error at contact that it adds at one standard deviation, root mean square [mm];
            0 without a contact.
        lateral_share: Share of its square in the squares of all effects that were tried.
        used: Standard deviation over the size at which docking falls below 95 %, or over 1.96 times that size
            where it is drawn for each tag; 0 without such a size.
        used_share: Share of its square in the squares of all effects that were tried.
    """

    effect: EffectResult
    lateral_mm: float
    lateral_share: float
    used: float
    used_share: float


def contributions(study: ToleranceStudy) -> list[Contribution]:
    """Return the contributions of the effects that the grades have, the first to be reduced first.

    That is the one that uses up most of what docking tolerates; among those that use up as many percent of it
    the one with the largest share in the lateral error.
    """
    graded = [effect for effect in study.effects if effect.graded]
    lateral = [0.0 if e.lateral is None else e.lateral.rms * e.step for e in graded]
    used = [_used(effect) for effect in graded]
    found = [
        Contribution(effect, mm, share, part, used_share)
        for effect, mm, share, part, used_share in zip(
            graded, lateral, _shares(lateral), used, _shares(used), strict=True
        )
    ]
    return sorted(found, key=lambda c: (round(c.used_share, 2), c.lateral_share), reverse=True)


def _shares(values: list[float]) -> list[float]:
    total = math.hypot(*values)
    return [(value / total) ** 2 if total else 0.0 for value in values]


def _used(effect: EffectResult) -> float:
    if effect.threshold is None:
        return 0.0
    # Where the size is a standard deviation, one in twenty errors exceeds the limit at the threshold.
    limit = effect.threshold * (_ONE_IN_TWENTY if effect.drawn else 1.0)
    return effect.step / limit


def predicted(found: Iterable[Contribution], grade: Grade) -> tuple[float, float]:
    """Return what the effects, each measured alone, predict for a grade if they are independent and normal.

    Lateral errors add up. So does what effects use up of one and the same limit, such as the largest gap that
    a robot may see when it is seated; docking fails when all of it is used up.

    Returns:
        Share of the trials that dock, and root mean square of the lateral error at contact [mm].
    """
    listed, factor = list(found), GRADES[grade]
    used = factor * math.hypot(*(contribution.used for contribution in listed))
    docked = 1.0 - 2.0 * NormalDist().cdf(-1.0 / used) if used else 1.0
    return docked, factor * math.hypot(*(contribution.lateral_mm for contribution in listed))
