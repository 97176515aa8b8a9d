"""Tuned controllers: the scene file that holds one, and those that ship."""

import numpy as np
import pytest
import yaml

from msrr_bullet.studies.search_space import SEARCH_SPACE, params_at, shipped_values
from msrr_bullet.studies.tuned_controller import Tuned, tuned_choice, tuned_name, tuned_scene
from msrr_scenes.loading.load import shipped_scenes

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
