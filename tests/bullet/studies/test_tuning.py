"""Tuning: equal budget and starts for every controller, and a result that is never worse than the default."""

import numpy as np
import pytest

from msrr_bullet.studies.docking_studies import run_docking
from msrr_bullet.studies.search_space import shipped_values
from msrr_bullet.studies.settings import Setting
from msrr_bullet.studies.tuning import SETTINGS, Objective, tune
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.specs.spec import Choice


def test_the_shipped_gains_cost_the_same_by_parameters_or_by_default() -> None:
    objective = Objective("docking", "c1", range(3))
    shipped = np.log(shipped_values("docking", "c1"))
    assert objective(shipped) == pytest.approx(objective.cost(Choice(name="c1")), rel=1e-3)


def test_refused_gains_cost_more_than_any_trial() -> None:
    """Anti-windup faster than the loop is refused by the law itself."""
    objective = Objective("docking", "c1", range(2))
    assert objective(np.log([0.4, 20.0, 0.2, 0.04])) == 1e3


def test_a_law_that_runs_away_costs_more() -> None:
    objective = Objective("docking", "linear", range(4))
    good, bad = objective(np.log([1.0])), objective(np.log([0.05]))
    assert good < 3.0 < bad


def test_tuning_keeps_to_its_budget_repeats_itself_and_helps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msrr_bullet.studies.tuning.SETTINGS", (Setting("ideal", ""),))
    monkeypatch.setattr("msrr_bullet.studies.tuning.POPULATION", 5)
    generations: list[tuple[int, float]] = []
    found = tune("linear", budget=10, trials=4, observer=lambda n, cost: generations.append((n, cost)))
    again = tune("linear", budget=10, trials=4)
    assert found == again
    assert found.budget == 10
    assert [n for n, _ in generations] == [1]
    # This holds on the four starts that were tuned on; the costs in the result are those of other starts.
    assert generations[-1][1] <= Objective("docking", "linear", range(*found.seeds)).cost(
        Choice(name="linear")
    )


def test_misuse_is_answered() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'linear'"):
        tune("lineer")
    with pytest.raises(ValueError, match="at least 32"):
        tune("linear", budget=10)


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.name)
def test_no_start_that_is_tuned_on_is_one_of_the_reproduction(
    setting: Setting, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[range] = []

    def cost(self: Objective, choice: Choice) -> float:
        seen.append(self.seeds)
        return 1.0

    monkeypatch.setattr(Objective, "cost", cost)
    tune("linear", budget=32)
    reported, *tuned = (
        run_docking(Choice(name="linear"), setting, seeds, duration_s=0.02).pose[0]
        for seeds in (range(200), *dict.fromkeys(seen))
    )
    assert len(tuned) == 2  # those tuned on, and those of the last judgement
    for starts in tuned:
        assert not (starts[:, None] == reported).all(axis=-1).any()
