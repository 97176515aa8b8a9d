"""How often a base station reads bodies that stand: rarely, and less so the nearer somebody drives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.base_station.base_station import BaseStation
from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.profiler import NullProfiler
from msrr_bullet.sensors.devices import Devices
from msrr_bullet.simulation.simulation import Simulation, open_simulation
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Detections, Pixels, TagDetection
from msrr_scenes.messages.coordination import UnitState
from msrr_scenes.placement.placement import Placement

#: Unit a drives; b stands within its reach, c far away.
PLACES = {"a": SE2(-1.2, 0.4, 0.3), "b": SE2(-0.8, -0.3, 1.0), "c": SE2(1.2, 0.2, -2.0)}

FRAME_NS = 100_000_000


class Watch:
    """A base station that watches units which are moved by hand, and believes that some drive."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.base = BaseStation(simulation.scene.told())
        self.camera = Devices(simulation, 0).overhead(NullProfiler())
        self.frame = 0
        self.read: list[set[str]] = []  # of each exposure

    def look(self, frames: int, driving: str = "") -> None:
        """Show the base station some exposures."""
        names = {tag: body.name for tag, body in self.base._vision.model.tags.items()}
        for _ in range(frames):
            state = [
                replace(u, state=UnitState.UNDER_WAY if u.unit in driving else UnitState.IDLE)
                for u in self.base.status.units
            ]
            self.base.status = replace(self.base.status, units=tuple(state))
            (message,) = self.camera.capture(self.frame * FRAME_NS, self.base)
            assert isinstance(message, Detections)
            self.base.see(message)
            self.read.append({names[tag.tag_id] for tag in message.tags})
            self.frame += 1

    def times_read(self, unit: str, frames: int) -> int:
        """Return how often a unit was read in the last exposures."""
        return sum(unit in found for found in self.read[-frames:])

    def error_m(self, unit: str) -> float:
        """Return how far from a unit the base station takes it to be."""
        known = self.base._tracker.poses(self.frame * FRAME_NS)[unit].X_WB
        return float(np.hypot(*(known.translation - self.simulation.plant.pose(unit).translation)))

    def sigma_m(self, unit: str) -> float:
        """Return the standard deviation of a unit's place, just before the next exposure."""
        known = self.base._tracker.poses(self.frame * FRAME_NS)[unit].covariance
        return float(np.sqrt(known.diagonal()[:2].max()))

    def move(self, unit: str, X_WU: SE2) -> None:
        world = self.simulation.world
        assert world is not None
        world.place(unit, X_WU, (0.0, 0.0))
        plant = self.simulation.plant
        assert isinstance(plant, KinematicPlant)
        plant._poses[unit] = X_WU  # nothing but a test carries a unit off

    def frames_until_known(self, unit: str, driving: str) -> int:
        """Return how many exposures it takes until the base station knows where a unit is."""
        for frame in range(60):
            if self.error_m(unit) < 0.005:
                return frame
            self.look(1, driving)
        raise AssertionError(f"{unit} was not found again")


@pytest.fixture
def simulation(line_of_three: Path) -> Iterator[Simulation]:
    scene = load_scene(line_of_three, {"perception": "images", "limits.v_max_mps": "0.4"})
    with open_simulation(scene, Placement(PLACES, {})) as simulation:
        yield simulation


@pytest.fixture
def watch(simulation: Simulation) -> Watch:
    return Watch(simulation)


def test_who_stands_far_from_all_who_drive_is_read_half_as_often(watch: Watch) -> None:
    watch.look(100, driving="a")
    assert [watch.times_read(unit, 80) for unit in "abc"] == [80, 8, 4]
    assert all(watch.error_m(unit) < 1e-3 for unit in PLACES)
    watch.look(40)  # nobody drives
    assert [watch.times_read(unit, 40) for unit in "abc"] == [2, 2, 2]
    watch.look(40, driving="ac")
    assert [watch.times_read(unit, 40) for unit in "abc"] == [40, 4, 40]


@pytest.mark.parametrize(("unit", "limit"), [("a", 5), ("b", 15), ("c", 25)])
def test_a_unit_that_was_moved_is_found_the_sooner_the_nearer_somebody_drives(
    watch: Watch, unit: str, limit: int
) -> None:
    """By a hand, 30 cm: the limit is the period of reading, and the frames until the track starts anew."""
    watch.look(30, driving="a")
    taken = []
    for way in (0.3, -0.3):
        watch.move(unit, watch.simulation.plant.pose(unit) @ SE2(way, 0.0, 0.0))
        assert watch.error_m(unit) > 0.25
        taken.append(watch.frames_until_known(unit, driving="a"))
        watch.look(27, driving="a")
    assert max(taken) <= limit, taken


def test_a_unit_that_was_pushed_stays_known_until_it_is_seen_to_stand_again(watch: Watch) -> None:
    """As by a dock, 1 mm: it might drive, and where it would be by then is not known after a second."""
    watch.look(40, driving="a")
    for way in (1e-3, -1e-3):
        watch.move("b", watch.simulation.plant.pose("b") @ SE2(way, 0.0, 0.0))
        seen = 0
        while not seen:
            watch.look(1, driving="a")
            seen = watch.times_read("b", 1)
        for _ in range(20):
            assert watch.sigma_m("b") < 0.01
            watch.look(1, driving="a")
        assert watch.times_read("b", 20) < 20, "it stands again, and is read rarely"
        watch.look(27, driving="a")


class _Blind:
    """A detector that finds nothing."""

    def detect(self, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        return ()


def test_large_tags_are_detected_at_less_resolution(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is missed there is read once more at the full resolution."""
    used: list[float] = []
    detect = PupilDetector.detect

    def note(self: PupilDetector, pixels: Pixels, window: Window) -> tuple[TagDetection, ...]:
        used.append(self.settings.quad_decimate)
        return detect(self, pixels, window)

    monkeypatch.setattr(PupilDetector, "detect", note)
    watch = Watch(simulation)
    watch.look(10, driving="a")
    used.clear()
    watch.look(20, driving="a")
    assert used
    assert min(used) >= 2.0
    monkeypatch.setattr(PupilDetector, "for_large_tags", lambda _: _Blind())
    watch = Watch(simulation)
    watch.look(10, driving="a")
    used.clear()
    watch.look(20, driving="a")
    assert watch.times_read("a", 20) == 20
    assert set(used) == {1.0}
