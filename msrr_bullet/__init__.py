"""A testbed in which mobile self-reconfigurable robots dock by what their cameras see.

What a notebook needs::

    from msrr_bullet import load_scene, run_trial, run_sweep, run_variation, plot_variation

These names are loaded when they are first asked for: much of this package (the robot, the replay) runs
without the simulator, and has to stay importable where there is none.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from msrr_bullet.run import run_trial
    from msrr_bullet.sweep.sweep import run_sweep
    from msrr_bullet.sweep.variation import run_variation
    from msrr_bullet.sweep.variation_plot import plot_variation
    from msrr_scenes.loading.load import load_scene

__all__ = ["load_scene", "plot_variation", "run_sweep", "run_trial", "run_variation"]

_MODULES = {
    "load_scene": "msrr_scenes.loading.load",
    "plot_variation": "msrr_bullet.sweep.variation_plot",
    "run_sweep": "msrr_bullet.sweep.sweep",
    "run_trial": "msrr_bullet.run",
    "run_variation": "msrr_bullet.sweep.variation",
}


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
