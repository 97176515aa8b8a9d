"""The base station: what it reads, what it passes on, and which scenes it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.base_station.base_station import BaseStation, coordination_setup
from msrr_control.coordination.goal_tolerance import DEFAULT_TOLERANCE
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import OVERHEAD, GlobalPose
from msrr_scenes.messages.coordination import MissionState, UnitState
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice

PERIOD_NS = 100_000_000


@pytest.fixture
def scene(line_of_three: Path) -> Scene:
    return load_scene(line_of_three)


def see(base: BaseStation, scene: Scene, now_ns: int) -> None:
    """Show the base station all units where the scene places them."""
    for name, unit in scene.units.items():
        base.see(GlobalPose(name, now_ns, unit.pose.nominal, 1e-6 * np.eye(3)))


def test_nothing_is_granted_before_all_units_are_known(scene: Scene) -> None:
    base = BaseStation(scene)
    assert base.uses_camera(OVERHEAD)
    assert not base.uses_camera("a/onboard")
    for step in range(20):
        granted = base.step(step * PERIOD_NS)
        assert all(authority.limit <= 0.0 or not authority.legs for authority in granted)
    assert {unit.state for unit in base.status.units} == {UnitState.IDLE}
    for step in range(20, 40):
        see(base, scene, step * PERIOD_NS)
        granted = [a for a in base.step(step * PERIOD_NS) if a.legs]
        if granted:
            break
    assert granted
    assert base.status.state is MissionState.RUNNING


def test_only_seen_poses_count(scene: Scene) -> None:
    """A base station that is shown other poses than those of the scene plans from the poses it is shown."""
    starts = []
    for shift in (0.0, 0.1):
        base = BaseStation(scene)
        for step in range(20):
            for name, unit in scene.units.items():
                X = SE2(shift, shift) @ unit.pose.nominal
                base.see(GlobalPose(name, step * PERIOD_NS, X, 1e-6 * np.eye(3)))
            legs = [a.legs for a in base.step(step * PERIOD_NS) if a.legs]
            if legs:
                starts.append(legs[0][0].start)
                break
    assert np.hypot(*np.subtract(starts[1], starts[0])[:2]) > 0.05


def test_a_scene_without_an_overhead_camera_is_refused(scene: Scene) -> None:
    cameras = scene.cameras.model_copy(update={"overhead": None})
    with pytest.raises(SceneError, match=r"cameras\.overhead"):
        BaseStation(scene.model_copy(update={"cameras": cameras}))


def test_a_law_without_routes_is_refused(scene: Scene) -> None:
    control = scene.control.model_copy(update={"assembly": Choice(name="my_module:MyLaw")})
    with pytest.raises(
        SceneError, match=r"control\.assembly: .* drive by 'c1' or 'c2', found 'my_module:MyLaw'"
    ):
        BaseStation(scene.model_copy(update={"control": control}))


def test_units_of_two_kinds_are_refused(scene: Scene) -> None:
    other = scene.units["c"].model_copy(update={"urdf": "other.urdf"})
    with pytest.raises(SceneError, match=r"units\.c\.urdf: .* units of one kind; see 'a'"):
        coordination_setup(scene.model_copy(update={"units": {**scene.units, "c": other}}))


def test_how_well_tags_are_held_says_how_near_the_end_of_a_move_a_unit_has_to_be_seen(scene: Scene) -> None:
    """By two standard deviations, as collision monitors reckon, and never by an error."""
    deviations = []
    for sigma, error in ((0.0, 0.0), (0.5, 0.0), (0.5, 4.0), (1.0, 0.0)):
        tags = f"{{yaw_deg: {{sigma: {sigma}, error: {error}}}}}"
        told = load_scene(scene.source, {"as_built.tags": tags}).told()
        deviations.append(coordination_setup(told).tolerance.yaw_rad - DEFAULT_TOLERANCE.yaw_rad)
    assert deviations == pytest.approx(np.radians([0.0, 1.0, 1.0, 2.0]))
