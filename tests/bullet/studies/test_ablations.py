"""Ablations of C1: each switches off one part and keeps the setting."""

from msrr_bullet.studies.ablations import SETTINGS, VARIANTS, ablation_jobs
from msrr_bullet.studies.settings import HIGH_GAIN


def test_an_ablation_switches_one_part_off_and_keeps_the_setting() -> None:
    jobs = {(j.phase, j.label): j for j in ablation_jobs(range(20)) if j.setting is HIGH_GAIN}
    complete, without = (jobs["close", label].run().success.rate for label in ("C1", "without anti-windup"))
    assert complete > 0.9 > 0.6 > without
    assert jobs["long", "without envelope"].run().success.rate == 0.0
    params = jobs["close", "without nonlinear term"].choice.params
    assert params == {"feedback": {"k_n_per_s": 6.0, "nonlinear": False}}


def test_every_variant_is_studied_in_every_setting() -> None:
    jobs = ablation_jobs(range(1))
    assert len(jobs) == len(SETTINGS) * sum(len(variants) for variants in VARIANTS.values())
    assert [j.label for j in jobs[: len(VARIANTS["long"])]] == list(VARIANTS["long"])
