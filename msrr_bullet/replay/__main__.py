"""Replays a run without the simulator and writes the report as JSON; run by :func:`replay_isolated`."""

import os
import sys
from pathlib import Path

from msrr_bullet.replay.isolation import REFUSED, SimulatorBarrier
from msrr_scenes.errors import MsrrError

# The report alone goes to standard output, and what a class of a user's own prints does not.
output = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
try:
    SimulatorBarrier.install()
    from msrr_bullet.replay.log_replay import replay

    report = replay(Path(sys.argv[1]), trust="--trust" in sys.argv[2:])
except MsrrError as error:
    sys.stderr.write(f"{error}\n")
    sys.exit(REFUSED)
with output:
    output.write(report.model_dump_json())
sys.exit(0 if report.identical else 1)
