"""Where the time of one trial goes, as a page with a tree and a flame graph."""

from __future__ import annotations

from pathlib import Path

from msrr_bullet.run import run_trial
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.scene import Scene
from msrr_scenes.whole_files import write_whole

#: Time between two samples [s].
_INTERVAL_S = 5e-4


def profile_trial(scene: Scene, path: Path) -> None:
    """Write a profile of the trial of seed 0 as HTML, after a first one that loads what a process loads once.

    Compiled kernels and the physics engine count for the functions that call them.

    Raises:
        MsrrError: pyinstrument is not installed, or the scene cannot be used.
    """
    try:
        from pyinstrument import Profiler
        from pyinstrument.renderers import HTMLRenderer
    except ModuleNotFoundError:
        raise MsrrError(
            "--profile needs the package pyinstrument: pip install 'msrr-bullet[profile]'"
        ) from None
    run_trial(scene)
    profiler = Profiler(interval=_INTERVAL_S)
    with profiler:
        run_trial(scene)
    write_whole(path, profiler.output(HTMLRenderer()))
