"""What tests of recordings share: the beginning of a trial with whole frames, and its target file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from msrr_bullet.log import Log, read_log, topics
from msrr_bullet.log.records import CameraWindow
from msrr_scenes.messages import Detections, Pixels, PoseEstimate, WheelOdometry
from msrr_scenes.specs.scene import Scene

#: Length of the trial [s]: a dozen frames, of which the last ones arrive too late.
LENGTH_S = 0.5


@dataclass(frozen=True)
class Trial:
    """The log of a trial, and what perception is told of it."""

    folder: Path
    log: Log
    target: Path

    def estimates(self) -> dict[int, PoseEstimate]:
        return dict(self.log.messages(PoseEstimate, topics.estimate("a")))

    def frames(self) -> list[tuple[int, int, Pixels]]:
        """Return time of exposure, time of arrival and pixels of every frame that arrived."""
        arrivals = {m.exposure: stamp for stamp, m in self.log.messages(Detections)}
        windows = (m for _, m in self.log.messages(CameraWindow))
        known = ((w.exposure.stamp_ns, arrivals.get(w.exposure), w.pixels) for w in windows)
        return [(stamp, arrival, pixels) for stamp, arrival, pixels in known if arrival is not None]

    def wheels(self) -> list[tuple[int, WheelOdometry]]:
        return list(self.log.messages(WheelOdometry))


@pytest.fixture(scope="package")
def trial(tmp_path_factory: pytest.TempPathFactory, shipped: Callable[..., Scene]) -> Trial:
    folder = tmp_path_factory.mktemp("trial")
    scene = shipped("close_range", {"cameras.onboard.readout": "frames", "time_limit_s": str(LENGTH_S)})
    run_trial_quietly(scene, folder)
    target = folder / "target.yaml"
    target.write_text(yaml.safe_dump(told(scene)))
    return Trial(folder, read_log(folder), target)


def run_trial_quietly(scene: Scene, folder: Path) -> None:
    """Run a trial for its log alone: a page and a picture would take longer than the trial."""
    from msrr_bullet.log import LogHeader
    from msrr_bullet.log.mcap_recorder import McapRecorder
    from msrr_bullet.trial.trial import Trial as SimulatedTrial

    with McapRecorder(folder / "trial.mcap", LogHeader.of(scene, 3, {})) as recorder:
        SimulatedTrial(scene, 3, recorder=recorder).run()


def told(scene: Scene) -> dict[str, object]:
    """Return the target file of the only step of a scene."""
    step = scene.docks[0]
    camera = scene.cameras.onboard.model_dump(mode="json", exclude_defaults=True)
    return {
        "unit": {"number": scene.units[step.target_unit].number, "port": step.target_port},
        "camera": {"hfov_deg": scene.cameras.onboard.hfov_deg, **camera},
        "odometry": scene.odometry.model_dump(mode="json", exclude_defaults=True),
    }
