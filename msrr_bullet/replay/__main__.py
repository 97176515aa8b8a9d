"""Replays a run without the simulator and writes the report as JSON; run by :func:`replay_isolated`."""

import sys
from pathlib import Path

from msrr_bullet.replay.isolation import REFUSED, SimulatorBarrier
from msrr_scenes.errors import MsrrError

try:
    SimulatorBarrier.install()
    from msrr_bullet.replay.log_replay import replay

    report = replay(Path(sys.argv[1]), trust="--trust" in sys.argv[2:])
except MsrrError as error:
    sys.stderr.write(f"{error}\n")
    sys.exit(REFUSED)
sys.stdout.write(report.model_dump_json())
sys.exit(0 if report.identical else 1)
