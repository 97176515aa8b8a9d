"""What one unit more costs in a mission: one that is under way, and one that stands by."""

from __future__ import annotations

from collections.abc import Callable

from pydantic import BaseModel

from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Shipped scene in which one unit docks to another one.
REFERENCE = "two_units"

#: Simulated times between which the trials are compared for a unit that stands by [s]: at the start all units
#: are searched for and the mission is planned.
_FROM_S, _TO_S = 5.0, 20.0

#: Times each trial is run. The smallest times are compared, which a busy machine changes least.
_REPEATS = 2


class UnitCost(BaseModel, frozen=True):
    """Cost of a unit in a mission of a base station, in wall-clock time per simulated second.

    Attributes:
        mover_ms_per_s: The mission over the number of units under way, on average over the mission.
        reference_ms_per_s: The shipped scene ``two_units`` at the same grade, in which one unit is under way.
        parked_ms_per_s: A unit of the mission that stands by, seen by the base station, while another docks.
    """

    mover_ms_per_s: float
    reference_ms_per_s: float
    parked_ms_per_s: float

    @property
    def mover_ratio(self) -> float:
        """Cost of a unit under way over that of the one in ``two_units``."""
        return self.mover_ms_per_s / self.reference_ms_per_s


def pair_of(scene: Scene, parked: bool, time_limit_s: float) -> Scene:
    """Return the beginning of a mission in which only the first unit moves, and docks to the last one.

    The mission has at least three units; without ``parked`` those between the two are left out.
    """
    first, *_, last = scene.units
    units = scene.units if parked else {name: scene.units[name] for name in (first, last)}
    alone = {"shape": None, "assembled": (), "faults": (), "units": units, "radio": scene.radio or {}}
    step = DockStep(unit=first, to=f"{last}.rear")
    return Scene.model_validate({**dict(scene), **alone, "plan": (step,), "time_limit_s": time_limit_s})


def measure_unit_cost(
    scene: Scene, seed: int, mover_ms_per_s: float, time_ms_per_s: Callable[[Scene, int], float]
) -> UnitCost:
    """Measure what a unit costs in a mission of at least three units.

    ``mover_ms_per_s`` is the mission over the number of units under way, and ``time_ms_per_s`` runs a trial
    and returns its wall-clock time per simulated second [ms].
    """
    scenes = {
        (parked, end): pair_of(scene, parked, end) for parked in (True, False) for end in (_FROM_S, _TO_S)
    }
    times = [
        {key: key[1] * time_ms_per_s(each, seed) for key, each in scenes.items()} for _ in range(_REPEATS)
    ]
    least = {key: min(each[key] for each in times) for key in scenes}
    crowd, pair = (least[parked, _TO_S] - least[parked, _FROM_S] for parked in (True, False))
    reference = load_scene(REFERENCE, {"as_built": scene.as_built.grade})
    return UnitCost(
        mover_ms_per_s=mover_ms_per_s,
        reference_ms_per_s=min(time_ms_per_s(reference, seed) for _ in range(2)),
        parked_ms_per_s=(crowd - pair) / (_TO_S - _FROM_S) / (len(scene.units) - 2),
    )
