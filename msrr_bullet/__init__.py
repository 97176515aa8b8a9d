"""A testbed in which mobile self-reconfigurable robots dock by what their cameras see.

The two names that a notebook needs::

    from msrr_bullet import load_scene, run_trial

They are loaded when they are first asked for: much of this package (the robot, the replay) runs without the
simulator, and has to stay importable where there is none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from msrr_bullet.run import run_trial
    from msrr_scenes.loading.load import load_scene

__all__ = ["load_scene", "run_trial"]


def __getattr__(name: str) -> Any:
    if name == "run_trial":
        from msrr_bullet.run import run_trial

        return run_trial
    if name == "load_scene":
        from msrr_scenes.loading.load import load_scene

        return load_scene
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
