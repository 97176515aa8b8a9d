"""The robot: what the collision monitor ignores in which phase, and which camera localises the unit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from msrr_bullet.robot.autonomy import Autonomy
from msrr_control.docking.controller import ControlInputs
from msrr_control.docking.law import DockSetup
from msrr_control.sequence.observation import Observation
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Action, Exposure, GlobalPose, Phase, PoseMeasurement, Twist
from msrr_scenes.specs.scene import Scene

DT_NS = 20_000_000
COVARIANCE = np.diag([1e-7, 1e-7, 1e-7])
AHEAD = Twist(0.1, 0.0)
FAR = SE2(-1.2, 1.0, 0.7)
#: Pose of the unit, and of a body whose rear is 5 cm in front of the tips of the pins.
HERE = SE2(0.1, -0.2, 0.4)
IN_FRONT = HERE @ SE2(0.118 + 0.05 + 0.1, 0.0, 0.0)


class StraightAssembler:
    """A user's long-distance phase that drives straight on, for ever or for a number of steps."""

    progress = path = None

    def __init__(self, setup: AssemblySetup, steps: float = math.inf) -> None:
        self._left = steps

    def reset(self, reason: str) -> None:
        self._left = 0.0

    def step(self, senses: Observation) -> Twist | None:
        self._left -= 1.0
        return AHEAD if self._left >= 0.0 else None


class StraightController:
    """A user's controller that drives straight on."""

    def __init__(self, setup: DockSetup) -> None: ...

    def reset(self, inputs: ControlInputs) -> None: ...

    def step(self, inputs: ControlInputs) -> Twist:
        return AHEAD


def _scene(**assembly: Any) -> Scene:
    return Scene.model_validate(
        {
            "name": "joints",
            "plant": "unicycle",
            "perception": "parametric",
            "units": {name: {"number": i} for i, name in enumerate("abc")},
            "cameras": {"overhead": {}},
            "control": {
                "assembly": {"name": f"{__name__}:StraightAssembler", "params": assembly},
                "docking": {"name": f"{__name__}:StraightController"},
            },
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


class Robot:
    """The robot of the scene, with messages that are not simulated."""

    def __init__(self, X_WB: SE2, X_WC: SE2 = FAR, **assembly: Any) -> None:
        scene = _scene(**assembly)
        self.autonomy = Autonomy(scene, scene.plan[0])
        self.X_WD = X_WB @ scene.geometry("b").dock_frame("rear")
        self._standing = {"b": X_WB, "c": X_WC}
        self._tick = 0

    def step(self, X_WA: SE2, X_DU_onboard: SE2 | None = None) -> Action:
        """Send the poses by the overhead camera and by the onboard camera, and return the action."""
        self._tick += 1
        now = self._tick * DT_NS
        for name, X in {"a": X_WA, **self._standing}.items():
            self.autonomy.receive(GlobalPose(name, now, X, COVARIANCE))
        if X_DU_onboard is not None:
            exposure = Exposure("a/onboard", self._tick, now)
            self.autonomy.receive(PoseMeasurement(exposure, X_DU_onboard, COVARIANCE, (0.1, -0.1)))
        return self.autonomy.step(now)


@pytest.mark.parametrize("in_front", ["target", "third unit", "nothing"])
def test_far_from_the_port_the_monitor_protects_every_unit(in_front: str) -> None:
    robot = {
        "target": lambda: Robot(IN_FRONT),
        "third unit": lambda: Robot(FAR @ SE2(1.0, 0.5), IN_FRONT),
        "nothing": lambda: Robot(FAR @ SE2(1.0, 0.5)),
    }[in_front]()
    for _ in range(5):
        action = robot.step(HERE)
        assert action.phase is Phase.ASSEMBLE
        assert 0.0 <= action.twist.v <= AHEAD.v
        assert (action.twist == AHEAD) is (in_front == "nothing")


@pytest.mark.parametrize("blocked", [False, True])
def test_while_docking_the_monitor_ignores_the_target_alone(blocked: bool) -> None:
    """The third unit stands across the lane when the pins are nearly in the port."""
    beside = IN_FRONT @ SE2(-0.1, 0.13, math.radians(90.0)) if blocked else FAR
    robot = Robot(IN_FRONT, beside, steps=0)
    X_DU = robot.X_WD.inverse() @ HERE
    actions = [robot.step(HERE, X_DU) for _ in range(5)]
    assert actions[-1].phase is Phase.DOCK
    assert (actions[-1].twist == AHEAD) is not blocked


def _own(robot: Robot) -> SE2:
    arena = robot.autonomy.estimates.arena
    assert arena is not None
    return arena.own.X_WB


def _same(a: SE2, b: SE2, atol: float = 1e-3) -> None:
    apart = a.inverse() @ b
    np.testing.assert_allclose(apart.as_array(), 0.0, atol=atol)


def test_the_unit_is_localised_by_the_overhead_camera_far_away_and_by_its_own_camera_near() -> None:
    """The cameras disagree by 3 cm and 5 deg."""
    robot = Robot(HERE @ SE2(0.6, 0.0), steps=3)
    from_above = HERE @ SE2(0.0, 0.03, math.radians(5.0))
    X_DU = robot.X_WD.inverse() @ HERE
    phases = []
    for _ in range(10):
        before = phases[-1] if phases else Phase.ASSEMBLE
        phases.append(robot.step(from_above, X_DU).phase)
        _same(_own(robot), from_above if before in (Phase.ASSEMBLE, Phase.HAND_OVER) else HERE)
    assert {Phase.ASSEMBLE, Phase.DOCK} <= set(phases)


def test_a_frame_that_arrives_in_the_long_distance_phase_was_exposed_before_it() -> None:
    """It began the filter anew, and the next docking phase with a pose as old as the way there."""
    robot = Robot(HERE @ SE2(0.6, 0.0), steps=3)
    poses = []
    while robot.step(HERE, robot.X_WD.inverse() @ HERE).phase is Phase.ASSEMBLE:
        poses.append(robot.autonomy.estimates.pose)
    assert poses == [None] * 3


def test_a_pose_by_the_onboard_camera_is_composed_with_the_target_by_the_overhead_camera() -> None:
    robot = Robot(HERE @ SE2(0.6, 0.0), steps=0)
    X_DU = SE2(-0.4, 0.05, -0.1)
    for _ in range(3):
        action = robot.step(HERE, X_DU)
    assert action.phase is Phase.DOCK
    _same(_own(robot), robot.X_WD @ X_DU)


def test_on_the_way_to_the_port_the_overhead_camera_corrects_the_onboard_camera() -> None:
    """They are 0.6 mm apart across the axis, of which the pose takes a share; in the port it keeps it."""
    robot = Robot(HERE @ SE2(0.6, 0.0), steps=0)
    X_DU, apart = SE2(-0.4, 0.0, 0.0), 6e-4
    for _ in range(8):
        action = robot.step(robot.X_WD @ X_DU @ SE2(0.0, apart), X_DU)
    assert action.phase is Phase.DOCK
    assert robot.autonomy.estimates.pose is not None
    assert 0.2 * apart < robot.autonomy.estimates.pose.X_DU.y < 0.8 * apart
    on_the_way = robot.autonomy.estimates.pose.X_DU.y
    in_port = SE2(-0.11, 0.0, 0.0)
    for _ in range(8):  # carried there, which the filter takes some frames to believe
        robot.step(robot.X_WD @ in_port, in_port)
    assert robot.autonomy.phase is Phase.DOCK
    assert robot.autonomy.estimates.pose.X_DU.x > -0.12
    assert robot.autonomy.estimates.pose.X_DU.y == pytest.approx(on_the_way, abs=1e-4)
