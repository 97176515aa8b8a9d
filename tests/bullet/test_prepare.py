"""What is compiled ahead of a trial is all that the trial needs compiled."""

from __future__ import annotations

import json
import subprocess
import sys

_PROGRAM = """
import importlib, json, pkgutil
from numba.core.dispatcher import Dispatcher
import msrr_bullet.render.raster as raster
import msrr_perception.kernels as kernels
from msrr_bullet import load_scene
from msrr_bullet.render.prepare import prepare_renderers
from msrr_bullet.trial.trial import Trial

modules = [
    importlib.import_module(module.name)
    for package in (kernels, raster)
    for module in pkgutil.iter_modules(package.__path__, package.__name__ + ".")
]

def compiled():
    return {
        f"{kernel.__module__}.{kernel.__name__}": [str(s) for s in kernel.signatures]
        for module in modules
        for kernel in vars(module).values()
        if isinstance(kernel, Dispatcher)
    }

far, near = (load_scene(name, {"time_limit_s": "3"}) for name in ("two_units", "close_range"))
prepare_renderers(far, lambda said: None)
ahead = compiled()
Trial(far, 0).run()
result = Trial(near, 0).run()
print(json.dumps([ahead, compiled(), result.records[-1].believed is not None]))
"""


def test_a_trial_compiles_nothing_more() -> None:
    """Else every worker of a pool would compile the rest for itself, in what looks like the robot's time."""
    done = subprocess.run([sys.executable, "-c", _PROGRAM], capture_output=True, text=True, check=True)
    ahead, after, saw_the_target = json.loads(done.stdout.splitlines()[-1])
    assert saw_the_target, "the filter ran"
    assert any(ahead.values()), "the list holds kernels"
    assert after == ahead
