"""What each part of C1 is worth, where the drive's limits bite."""

from __future__ import annotations

from typing import Any

from msrr_bullet.studies.close_studies import close_row, merged
from msrr_bullet.studies.long_studies import long_row
from msrr_bullet.studies.measures import PhaseName
from msrr_bullet.studies.model import Row
from msrr_bullet.studies.settings import HARD, HIGH_GAIN, LONG_DELAY, STANDARD, TIGHT_HIGH_GAIN, Setting
from msrr_scenes.specs.spec import Choice

#: Where ablations are made; in the first one limits do not bite, and little is expected of most parts.
SETTINGS = (STANDARD, HARD, LONG_DELAY, HIGH_GAIN, TIGHT_HIGH_GAIN)

#: C1 with one of its switches off, by phase and label.
VARIANTS: dict[PhaseName, dict[str, dict[str, Any]]] = {
    "long": {
        "C1": {},
        "without envelope": {"envelope": False},
        "without anti-windup": {"anti_windup": False},
        "without spring": {"spring": False},
    },
    "close": {
        "C1": {},
        "without LOS correction": {"los_correction": False},
        "without anti-windup": {"anti_windup": False},
        "without nonlinear term": {"feedback": {"nonlinear": False}},
    },
}

AblationJob = tuple[PhaseName, str, Setting, range]


def ablation_jobs(seeds: range) -> list[AblationJob]:
    """Return every variant of C1 in every setting."""
    phases: tuple[PhaseName, ...] = ("long", "close")
    return [(p, label, setting, seeds) for p in phases for setting in SETTINGS for label in VARIANTS[p]]


def ablation_row(job: AblationJob) -> Row:
    """Study one variant in one setting."""
    phase, label, setting, seeds = job
    laid_over = setting.long_params if phase == "long" else setting.close_params
    choice = Choice(name="c1", params=merged(laid_over, VARIANTS[phase][label]))
    return (long_row if phase == "long" else close_row)(choice, label, setting, seeds)
