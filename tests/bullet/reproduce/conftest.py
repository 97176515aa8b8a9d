"""Small reproductions for the tests: one on unicycles, and trials of the loop without contact or pixels."""

import pytest

from msrr_bullet.reproduce import unicycle_studies
from msrr_bullet.studies.model import Reproduction
from msrr_bullet.studies.settings import HARD, STANDARD
from msrr_scenes.specs.spec import Choice


@pytest.fixture(scope="session")
def unicycle_results() -> Reproduction:
    """A whole reproduction on unicycles with three trials and a map of four cells."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unicycle_studies, "GAINS", (0.8, 6.0, 6.0, 6.0))
        patch.setattr(unicycle_studies, "LATENCIES", (0.0, 0.1, 0.1, 0.1))
        patch.setattr(unicycle_studies, "TABLES", (STANDARD, HARD))
        patch.setattr("msrr_bullet.studies.ablations.SETTINGS", (STANDARD,))
        contenders = {
            "long": {"C1": Choice(name="c1")},
            "close": {"C2": Choice(name="c2"), "C1": Choice(name="c1"), "CBF": Choice(name="cbf")},
        }
        return unicycle_studies.reproduce_unicycle(range(3), contenders)


@pytest.fixture
def blind_loop() -> dict[str, str]:
    """Overrides that replace contact and pixels by models: a trial of the loop in a fraction of a second."""
    return {"plant": "unicycle", "perception": "parametric"}
