"""The rows of a table as jobs for a pool of processes, and the ablations of C1 as such jobs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from msrr_bullet.studies.docking_studies import docking_row
from msrr_bullet.studies.measures import PHASES, PhaseName
from msrr_bullet.studies.model import Row
from msrr_bullet.studies.path_following_studies import path_following_row
from msrr_bullet.studies.settings import (
    HARD,
    HIGH_GAIN,
    LONG_DELAY,
    STANDARD,
    TIGHT_HIGH_GAIN,
    Setting,
    merge_params,
)
from msrr_scenes.specs.spec import Choice

#: Settings of the ablations. In the first one limits do not bite, and most parts make no difference.
SETTINGS = (STANDARD, HARD, LONG_DELAY, HIGH_GAIN, TIGHT_HIGH_GAIN)

#: C1 with one of its parts switched off, by phase and label.
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


@dataclass(frozen=True)
class RowJob:
    """The study of one controller in one setting."""

    phase: PhaseName
    choice: Choice
    label: str
    setting: Setting
    seeds: range

    def run(self) -> Row:
        """Run the study and return its row of a table."""
        make_row = path_following_row if self.phase == "long" else docking_row
        return make_row(self.choice, self.label, self.setting, self.seeds)


def ablation_jobs(seeds: range) -> list[RowJob]:
    """Return a job for every variant of C1 in every setting, in the order of phases, settings, variants."""
    jobs = []
    for phase in PHASES:
        for setting in SETTINGS:
            params = setting.path_following_params if phase == "long" else setting.docking_params
            for label, switched_off in VARIANTS[phase].items():
                choice = Choice(name="c1", params=merge_params(params, switched_off))
                jobs.append(RowJob(phase, choice, label, setting, seeds))
    return jobs
