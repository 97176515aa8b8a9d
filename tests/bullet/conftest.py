"""A drive made up by hand, for what only shows trials: quicker than a trial, and known to the millimetre."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest

from msrr_bullet.clearance import ClearanceModel
from msrr_bullet.viewer.snapshot import Snapshot
from msrr_scenes.load import load_scene
from msrr_scenes.messages import LosObservation, LosStatus, Phase
from msrr_scenes.scene import Scene
from msrr_scenes.se2 import SE2

PHASES = (
    (0.06, Phase.HAND_OVER),
    (0.75, Phase.DOCK),
    (0.85, Phase.LOCK),
    (0.95, Phase.VERIFY),
    (2.0, Phase.DONE),
)


@dataclass(frozen=True)
class Drive:
    """A scene and the instants of a made-up trial in it."""

    scene: Scene
    frames: tuple[Snapshot, ...]


@pytest.fixture(scope="session")
def drive() -> Drive:
    """Unit a of scene ``bystander`` drives to the rear of b in 8 s; it believes to be up to 12 mm left."""
    scene = load_scene("bystander")
    step, los = scene.plan[0], scene.los
    bystanders = {name: scene.units[name].pose.nominal for name in ("b", "c")}
    posts = {name: spec.pose.nominal for name, spec in scene.obstacles.items()}
    model = ClearanceModel(scene)
    X_WD = bystanders["b"] @ scene.geometry("b").dock_frame("rear")
    frames = []
    count = 200
    for i in range(count):
        done = i / (count - 1)
        left = max(0.0, 1.0 - done / 0.75)
        X_WU = X_WD @ SE2(-0.1 - 0.7 * left, 0.12 * left**2, -0.3 * left)
        X_UD = X_WU.inverse() @ X_WD
        edges = [X_UD.act([los.setback_m, side * los.half_width_m]) for side in (1.0, -1.0)]
        angles = [math.atan2(p[1], p[0]) for p in edges]
        status = LosStatus.SEEN if i % 20 < 16 else LosStatus.PREDICTED
        stamp_ns = round(8e9 * done)
        units = {"a": X_WU, **bystanders}
        frames.append(
            Snapshot(
                stamp_ns=stamp_ns,
                units=units,
                obstacles=posts,
                step=step,
                estimate=X_WU @ SE2(0.0, 0.012 * left) if i > 5 else None,
                phase=next(phase for until, phase in PHASES if done < until),
                attempt=1,
                los=LosObservation(stamp_ns, angles[0], angles[1], 0.2, status) if i > 5 else None,
                clearance=model.minimum({**units, **posts}),
            )
        )
    return Drive(scene, tuple(frames))
