"""The parameters of each controller that are tuned, with their ranges."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Literal

import numpy as np

from msrr_bullet.studies.settings import merge_params
from msrr_control.docking.barrier import BarrierParams
from msrr_control.docking.c1 import C1DockingParams, LinearParams
from msrr_control.docking.c2 import C2DockingParams
from msrr_control.docking.graceful import GracefulParams
from msrr_control.path_following.c1 import C1PathFollowingParams
from msrr_control.path_following.c2 import C2PathFollowingParams
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Spec

#: The two controllers of a unit: close-range docking, and long-distance assembly.
Part = Literal["docking", "assembly"]


@dataclass(frozen=True, slots=True)
class SearchParameter:
    """A parameter that is tuned: dotted name, and lower and upper bound of its logarithmic range."""

    name: str
    low: float
    high: float


_CONE = SearchParameter("cone.reach_m", 0.01, 0.12)

SEARCH_SPACE: dict[Part, dict[str, tuple[SearchParameter, ...]]] = {
    "docking": {
        "c1": (
            SearchParameter("feedback.k_n_per_s", 0.4, 8.0),
            SearchParameter("feedback.predefined_s", 6.0, 80.0),
            SearchParameter("windup.k_mps", 0.01, 0.2),
            _CONE,
        ),
        "c2": (
            SearchParameter("feedback.k_per_s", 0.4, 8.0),
            SearchParameter("feedback.reach_mps", 0.004, 0.2),
            SearchParameter("feedback.layer_m", 0.004, 0.08),
            _CONE,
        ),
        "linear": (SearchParameter("k_n_per_s", 0.4, 8.0),),
        "cbf": (
            SearchParameter("k_n_per_s", 0.4, 8.0),
            SearchParameter("braking", 0.2, 0.95),
            SearchParameter("rho_rad", 0.01, 0.2),
            SearchParameter("margin_deg", 0.5, 8.0),
        ),
        "graceful": (
            SearchParameter("k1", 0.5, 8.0),
            SearchParameter("k2", 1.0, 20.0),
            SearchParameter("slow_down", 0.01, 1.0),
            SearchParameter("ahead_m", 0.03, 0.2),
        ),
    },
    "assembly": {
        "c1": (
            SearchParameter("guidance.c1_per_s", 0.3, 3.0),
            SearchParameter("guidance.c2_per_s", 1.4, 4.0),
            SearchParameter("tracking.k_l_per_s", 0.7, 5.0),
            SearchParameter("guidance.envelope.rho", 0.015, 0.15),
        ),
        "c2": (
            SearchParameter("feedback.k_per_s", 0.4, 5.0),
            SearchParameter("feedback.reach_mps", 0.004, 0.2),
            SearchParameter("feedback.layer_m", 0.004, 0.1),
            SearchParameter("repulsion.eta", 0.002, 0.06),
        ),
    },
}

_SPECS: dict[Part, dict[str, type[Spec]]] = {
    "docking": {
        "c1": C1DockingParams,
        "c2": C2DockingParams,
        "linear": LinearParams,
        "cbf": BarrierParams,
        "graceful": GracefulParams,
    },
    "assembly": {"c1": C1PathFollowingParams, "c2": C2PathFollowingParams},
}


def params_at(part: Part, controller: str, point: Array) -> dict[str, Any]:
    """Return a controller's parameters at a point of its search space, to four significant digits.

    The point is the logarithms of the tuned parameters, shape (number of parameters,). A group of parameters
    of which one is tuned is given as a whole.
    """
    shipped = _SPECS[part][controller]().model_dump()
    params: dict[str, Any] = {}
    for parameter, value in zip(SEARCH_SPACE[part][controller], np.exp(point), strict=True):
        names = parameter.name.split(".")
        params.setdefault(names[0], shipped[names[0]])
        nested: Any = float(f"{value:.4g}")
        for name in reversed(names):
            nested = {name: nested}
        params = merge_params(params, nested)
    return params


def shipped_values(part: Part, controller: str) -> list[float]:
    """Return the default values of the parameters of a controller that are tuned."""
    spec = _SPECS[part][controller]()
    return [float(attrgetter(parameter.name)(spec)) for parameter in SEARCH_SPACE[part][controller]]
