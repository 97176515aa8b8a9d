"""One tuning procedure for every controller: the same optimiser, budget, objective and settings.

Differential evolution over the controller's own gains, on unicycles, with the same starts and noise in every
evaluation. The first candidate is the controller as it ships, so that nothing worse than that is found on
these. What is found is judged once more on starts and noise that were not tuned on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import qmc

from msrr_bullet.studies.close_studies import captured, run_close
from msrr_bullet.studies.long_studies import run_long
from msrr_bullet.studies.measures import LONG
from msrr_bullet.studies.search_space import KNOBS, Part, params_of, shipped_values
from msrr_bullet.studies.settings import HARD, STANDARD, Setting
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError, UnknownNameError
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.plan import GuardSpec
from msrr_scenes.specs.spec import Choice

#: Candidates of one generation.
POPULATION = 16

#: A controller that is tuned must do well in both: the paper's conditions, and where limits bite.
SETTINGS = (STANDARD, HARD)

#: Cost of parameters that the controller itself refuses.
_REFUSED = 1e3

#: Cost of a trial that fails, or that loses sight of its target.
_FAILED = 10.0


class Tuned(BaseModel):
    """What tuning found.

    Attributes:
        part: Which of a unit's two controllers.
        controller: Its registered name.
        params: Its parameters.
        budget: Evaluations of the objective.
        cost_shipped: Of the controller as it ships, on starts and noise that were not tuned on.
        cost_tuned: The same of the parameters found.
        seeds: First seed, and one beyond the last, of the starts and noise that were tuned on.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    part: Part
    controller: str
    params: dict[str, Any]
    budget: int
    cost_shipped: float
    cost_tuned: float
    seeds: tuple[int, int]


def tune(
    controller: str,
    part: Part = "docking",
    budget: int = 240,
    seed: int = 0,
    trials: int = 40,
    mapper: Callable[[Callable[[Array], float], Iterable[Array]], Iterable[float]] | None = None,
    observer: Callable[[int, float], None] | None = None,
) -> Tuned:
    """Tune one controller.

    Args:
        controller: Its registered name.
        part: Which of a unit's two controllers it is.
        budget: Evaluations of the objective, at least two generations of ``POPULATION``.
        seed: Of the optimiser, the starts and the noise.
        trials: Per setting and evaluation.
        mapper: Runs the candidates of a generation: ``map``, or that of a process pool.
        observer: Is told, after each generation, its number and the lowest cost so far.

    Raises:
        UnknownNameError: Nothing is known of this controller's gains.
        ValueError: The budget is too small for the procedure.
    """
    known = KNOBS[part]
    if controller not in known:
        raise UnknownNameError(f"{part} controller that can be tuned", controller, known, "")
    if budget < 2 * POPULATION:
        raise ValueError(f"expected a budget of at least {2 * POPULATION} evaluations, found {budget}")
    knobs = known[controller]
    seeds = range(1000 * seed, 1000 * seed + trials)
    objective = Objective(part, controller, seeds)
    rounds = budget // POPULATION - 1
    low, high = np.log([k.low for k in knobs]), np.log([k.high for k in knobs])
    rng = stream(seed, f"tuning/{part}/{controller}")
    candidates = low + (high - low) * qmc.LatinHypercube(len(knobs), rng=rng).random(POPULATION)
    candidates[0] = np.clip(np.log(shipped_values(part, controller)), low, high)
    generation = 0

    def told(intermediate_result: Any) -> None:
        nonlocal generation
        generation += 1
        if observer is not None:
            observer(generation, float(intermediate_result.fun))

    found = differential_evolution(
        objective,
        Bounds(low, high),
        init=candidates,
        maxiter=rounds,
        tol=0.0,
        atol=0.0,
        polish=False,
        rng=rng,
        updating="deferred",
        workers=mapper if mapper is not None else map,
        callback=told,
    )
    others = Objective(part, controller, range(seeds.stop, seeds.stop + 4 * trials))
    return Tuned(
        part=part,
        controller=controller,
        params=params_of(part, controller, found.x),
        budget=int(found.nfev),
        cost_shipped=round(others.cost(Choice(name=controller)), 4),
        cost_tuned=round(others(found.x), 4),
        seeds=(seeds.start, seeds.stop),
    )


@dataclass(frozen=True)
class Objective:
    """The cost of a controller, the lower the better: the mean over the settings of a sum of ratios.

    Close phase: 95th percentiles at contact of the lateral error over 5 mm, of the yaw error over 2 deg and
    of the time it took over 10 s; ten times the share of trials that do not come to the face where the
    mechanism captures them, and ten times the share that loses the target. Long phase: 95th percentiles of
    tracking error, amplitude and recovery over the paper's figures of its own law, and ten times the share
    that comes nearer to the obstacle than the clearance guard would let it.
    """

    part: Part
    controller: str
    seeds: range

    def __call__(self, x: Array) -> float:
        """Return the cost of one candidate; ``x`` holds the logarithms of the knobs."""
        params = params_of(self.part, self.controller, x)
        return self.cost(Choice(name=self.controller, params=params))

    def cost(self, choice: Choice) -> float:
        """Return the cost of a controller."""
        of = _close_cost if self.part == "docking" else _long_cost
        try:
            return float(np.mean([of(choice, setting, self.seeds) for setting in SETTINGS]))
        except SceneError:
            return _REFUSED


def _close_cost(choice: Choice, setting: Setting, seeds: range) -> float:
    result = run_close(choice, setting, seeds, duration=12.0)
    failed = 1.0 - float(captured(result).mean())
    lost = 1.0 - float(result.in_cone(setting.dock_setup().los.outer).mean())
    cost = _FAILED * (failed + lost)
    if not result.docked.any():
        return cost + _FAILED
    lateral, yaw = result.at_contact()
    took = result.dt * result.contact[result.docked]
    for values, over in ((np.abs(lateral), 0.005), (np.abs(yaw), math.radians(2.0)), (took, 10.0)):
        cost += float(np.quantile(values, 0.95)) / over
    return cost


def _long_cost(choice: Choice, setting: Setting, seeds: range) -> float:
    result = run_long(choice, setting, seeds)
    nearest = result.body_distance() - (setting.long_starts.obstacle_m or 0.0)
    cost = _FAILED * float(np.mean(nearest < GuardSpec().stop_m))
    found = {
        "tracking": result.tracking_error(),
        "amplitude": result.amplitude(),
        "recovery": result.recovery_time(),
    }
    for what in LONG:
        if what.key not in found or what.paper_c1 is None:
            continue
        values = found[what.key]
        # Without a steady stretch to judge there is nothing good to say.
        known = np.isfinite(values)
        cost += float(np.quantile(values[known], 0.95)) / what.paper_c1 if known.any() else _FAILED
    return cost
