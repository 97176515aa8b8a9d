"""What is tuned of each controller: its knobs, and how a point in their space becomes parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.studies.close_studies import merged
from msrr_control.docking.barrier import BarrierParams
from msrr_control.docking.c1 import CloseRangeParams, LinearParams
from msrr_control.docking.c2 import ComparisonCloseParams
from msrr_control.docking.graceful import GracefulParams
from msrr_control.path_following.baseline import ComparisonLongParams
from msrr_control.path_following.c1 import LongRangeParams
from msrr_scenes.specs.spec import Spec

Array = NDArray[np.float64]
Part = Literal["docking", "assembly"]


@dataclass(frozen=True, slots=True)
class Knob:
    """One parameter that is tuned, by its dotted name, and its range on a logarithmic scale."""

    name: str
    low: float
    high: float


_CONE = Knob("cone.reach_m", 0.01, 0.12)

KNOBS: dict[Part, dict[str, tuple[Knob, ...]]] = {
    "docking": {
        "c1": (
            Knob("feedback.k_n_per_s", 0.4, 8.0),
            Knob("feedback.predefined_s", 6.0, 80.0),
            Knob("windup.k_mps", 0.01, 0.2),
            _CONE,
        ),
        "c2": (
            Knob("feedback.k_per_s", 0.4, 8.0),
            Knob("feedback.reach_mps", 0.004, 0.2),
            Knob("feedback.layer_m", 0.004, 0.08),
            _CONE,
        ),
        "linear": (Knob("k_n_per_s", 0.4, 8.0),),
        "cbf": (
            Knob("k_n_per_s", 0.4, 8.0),
            Knob("braking", 0.2, 0.95),
            Knob("rho_rad", 0.01, 0.2),
            Knob("margin_deg", 0.5, 8.0),
        ),
        "graceful": (
            Knob("k1", 0.5, 8.0),
            Knob("k2", 1.0, 20.0),
            Knob("slow_down", 0.01, 1.0),
            Knob("ahead_m", 0.03, 0.2),
        ),
    },
    "assembly": {
        "c1": (
            Knob("guidance.c1_per_s", 0.3, 3.0),
            Knob("guidance.c2_per_s", 1.4, 4.0),
            Knob("tracking.k_l_per_s", 0.7, 5.0),
            Knob("guidance.envelope.rho", 0.015, 0.15),
        ),
        "c2": (
            Knob("feedback.k_per_s", 0.4, 5.0),
            Knob("feedback.reach_mps", 0.004, 0.2),
            Knob("feedback.layer_m", 0.004, 0.1),
            Knob("repulsion.eta", 0.002, 0.06),
        ),
    },
}


_SPECS: dict[Part, dict[str, type[Spec]]] = {
    "docking": {
        "c1": CloseRangeParams,
        "c2": ComparisonCloseParams,
        "linear": LinearParams,
        "cbf": BarrierParams,
        "graceful": GracefulParams,
    },
    "assembly": {"c1": LongRangeParams, "c2": ComparisonLongParams},
}


def params_of(part: Part, controller: str, x: Array) -> dict[str, Any]:
    """Return a controller's parameters from the logarithms of its knobs, to four significant digits.

    A group of parameters of which one is tuned is given as a whole.
    """
    shipped = _shipped(part, controller).model_dump()
    params: dict[str, Any] = {}
    for knob, value in zip(KNOBS[part][controller], np.exp(x), strict=True):
        group = knob.name.partition(".")[0]
        params.setdefault(group, shipped[group])
        nested: Any = float(f"{value:.4g}")
        for name in reversed(knob.name.split(".")):
            nested = {name: nested}
        params = merged(params, nested)
    return params


def shipped_values(part: Part, controller: str) -> list[float]:
    """Return the values of a controller's knobs as it ships."""
    values = []
    for knob in KNOBS[part][controller]:
        at: Any = _shipped(part, controller)
        for name in knob.name.split("."):
            at = getattr(at, name)
        values.append(float(at))
    return values


def _shipped(part: Part, controller: str) -> Spec:
    return _SPECS[part][controller]()
