"""One tuning procedure for every controller: the same optimiser, budget, objective and settings.

The optimiser is differential evolution over the controller's gains, on unicycles, with the same starts and
noise in every evaluation. The first candidate is the controller as it ships, so that on these starts the
result is never worse than that. The result is judged once more on starts and noise that were not tuned on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import qmc

from msrr_bullet.studies.docking_studies import captured, run_docking
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.path_following_studies import run_path_following
from msrr_bullet.studies.search_space import SEARCH_SPACE, Part, params_at, shipped_values
from msrr_bullet.studies.settings import HARD, STANDARD, Setting
from msrr_bullet.studies.tuned_controller import Tuned
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError, UnknownNameError
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.control import GuardSpec
from msrr_scenes.specs.spec import Choice

#: Number of candidates in one generation.
POPULATION = 16

#: A controller that is tuned must do well in both: under the paper's conditions, and where limits bite.
SETTINGS = (STANDARD, HARD)

#: First seed that is tuned on with seed 0. The tables of a reproduction begin at 0, and a close phase has the
#: same first starts however many are drawn.
_FIRST_SEED = 1_000_000

#: Cost of parameters that the controller itself refuses.
_REFUSED = 1e3

#: Cost of a trial that fails, or that loses sight of its target.
_FAILED = 10.0


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
        controller: Registered name of the controller.
        part: Which of a unit's two controllers it is.
        budget: Number of evaluations of the objective, at least two generations of ``POPULATION``.
        seed: Seed of the optimiser, the starts and the noise.
        trials: Number of trials per setting and evaluation.
        mapper: Runs the candidates of a generation: ``map``, or that of a process pool.
        observer: Called after each generation with its number and the lowest cost so far.

    Raises:
        UnknownNameError: No search space is known for this controller.
        ValueError: The budget is too small for the procedure.
    """
    known = SEARCH_SPACE[part]
    if controller not in known:
        raise UnknownNameError(f"{part} controller", controller, known, "Only these can be tuned.")
    if budget < 2 * POPULATION:
        raise ValueError(f"expected a budget of at least {2 * POPULATION} evaluations, found {budget}")
    space = known[controller]
    first = _FIRST_SEED + 1000 * seed
    seeds = range(first, first + trials)
    objective = Objective(part, controller, seeds)
    low, high = np.log([p.low for p in space]), np.log([p.high for p in space])
    rng = stream(seed, f"tuning/{part}/{controller}")
    candidates = low + (high - low) * qmc.LatinHypercube(len(space), rng=rng).random(POPULATION)
    candidates[0] = np.clip(np.log(shipped_values(part, controller)), low, high)
    generation = 0

    def end_generation(intermediate_result: Any) -> None:
        nonlocal generation
        generation += 1
        if observer is not None:
            observer(generation, float(intermediate_result.fun))

    best = differential_evolution(
        objective,
        Bounds(low, high),
        init=candidates,
        maxiter=budget // POPULATION - 1,
        tol=0.0,
        atol=0.0,
        polish=False,
        rng=rng,
        updating="deferred",
        workers=mapper if mapper is not None else map,
        callback=end_generation,
    )
    validation = Objective(part, controller, range(seeds.stop, seeds.stop + 4 * trials))
    return Tuned(
        part=part,
        controller=controller,
        params=params_at(part, controller, best.x),
        budget=int(best.nfev),
        cost_shipped=round(validation.cost(Choice(name=controller)), 4),
        cost_tuned=round(validation(best.x), 4),
        seeds=(seeds.start, seeds.stop),
    )


@dataclass(frozen=True)
class Objective:
    """The cost of a controller, the lower the better: the mean over the settings of a sum of ratios.

    Close phase: the 95th percentiles of the lateral error at contact over 5 mm, of the yaw error at contact
    over 2 deg and of the time to contact over 10 s; ten times the share of trials that do not come to the
    face inside the mechanism's capture range, and ten times the share that loses the target. Long phase: the
    95th percentiles of tracking error, amplitude and recovery over the paper's values for its own law, and
    ten times the share of trials that come nearer to the obstacle than the collision monitor would allow.
    """

    part: Part
    controller: str
    seeds: range

    def __call__(self, point: Array) -> float:
        """Return the cost of a candidate, given as the logarithms of its parameters."""
        return self.cost(Choice(name=self.controller, params=params_at(self.part, self.controller, point)))

    def cost(self, choice: Choice) -> float:
        """Return the cost of a controller."""
        cost_in = _docking_cost if self.part == "docking" else _path_following_cost
        try:
            return float(np.mean([cost_in(setting, choice, self.seeds) for setting in SETTINGS]))
        except SceneError:
            return _REFUSED


def _docking_cost(setting: Setting, choice: Choice, seeds: range) -> float:
    result = run_docking(choice, setting, seeds, duration_s=12.0)
    failed = 1.0 - float(captured(result).mean())
    lost = 1.0 - float(result.in_cone(setting.dock_setup().los.outer).mean())
    cost = _FAILED * (failed + lost)
    if not result.at_face.any():
        return cost + _FAILED
    lateral, yaw = result.at_contact()
    time = result.dt * result.contact[result.at_face]
    for values, unit in ((np.abs(lateral), 0.005), (np.abs(yaw), math.radians(2.0)), (time, 10.0)):
        cost += float(np.quantile(values, 0.95)) / unit
    return cost


def _path_following_cost(setting: Setting, choice: Choice, seeds: range) -> float:
    result = run_path_following(choice, setting, seeds)
    clearance = result.body_distance().min(axis=0) - (setting.path_following_starts.obstacle_m or 0.0)
    cost = _FAILED * float(np.mean(clearance < GuardSpec().stop_m))
    figures = result.figures()
    for key in ("tracking", "amplitude", "recovery"):
        values = figures[key]
        cost += _FAILED * float(np.mean(np.isinf(values)))  # never recovered
        # Without any trial that has a steady stretch to judge, the law has failed.
        known = values[np.isfinite(values)]
        cost += (
            float(np.quantile(known, 0.95)) / (measure(key).paper_c1 or math.nan) if known.size else _FAILED
        )
    return cost
