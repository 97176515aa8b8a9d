"""Tuned controllers: the scene file that holds one, and those that ship."""

import re

import numpy as np
import pytest
import yaml

from msrr_bullet.studies.search_space import SEARCH_SPACE, params_at, shipped_values
from msrr_bullet.studies.tuned_controller import Tuned, tuned_choice, tuned_name, tuned_scene
from msrr_bullet.studies.tuning import Objective
from msrr_scenes.loading.load import find_scene, shipped_scenes
from msrr_scenes.specs.spec import Choice

EVERY = [(part, name) for part, names in SEARCH_SPACE.items() for name in names]


@pytest.mark.parametrize(("part", "name"), EVERY)
def test_the_scene_holds_the_parameters(part, name: str) -> None:
    params = params_at(part, name, np.log(shipped_values(part, name)))
    tuned = Tuned(
        part=part, controller=name, params=params, budget=1, cost_shipped=1.0, cost_tuned=1.0, seeds=(0, 1)
    )
    assert yaml.safe_load(tuned_scene(tuned))["control"][part] == {"name": name, "params": params}


def test_the_shipped_scenes_load() -> None:
    shipped = [name for name in shipped_scenes() if name.startswith("tuned_")]
    for name in shipped:
        part = "assembly" if "_assembly_" in name else "docking"
        controller = name.rpartition("_")[2]
        assert tuned_name(part, controller) == name
        choice = tuned_choice(part, controller)
        assert choice is not None
        assert choice.params
    assert tuned_choice("docking", "nobody") is None


@pytest.mark.nightly
@pytest.mark.parametrize(("part", "name"), EVERY)
def test_the_costs_in_a_shipped_scene_are_those_of_its_parameters(part, name: str) -> None:
    text = find_scene(tuned_name(part, name)).read_text(encoding="utf-8")
    head = " ".join(line.removeprefix("# ") for line in text.splitlines() if line.startswith("# "))
    said = r"seeds (\d+):(\d+)\. Cost on other seeds: ([\d.]+) as shipped, ([\d.]+) tuned"
    found = re.search(said, head)
    assert found is not None, head
    first, stop = int(found[1]), int(found[2])
    other = Objective(part, name, range(stop, stop + 4 * (stop - first)))
    choice = tuned_choice(part, name)
    assert choice is not None
    assert other.cost(Choice(name=name)) == pytest.approx(float(found[3]), abs=1e-3)
    assert other.cost(choice) == pytest.approx(float(found[4]), abs=1e-3)
