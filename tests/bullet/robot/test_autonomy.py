"""The robot's own joints: what the guard is told in which phase, and which camera says where the unit is."""

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
SURE = np.diag([1e-7, 1e-7, 1e-7])
AHEAD = Twist(0.1, 0.0)
FAR = SE2(-1.2, 1.0, 0.7)
#: Where the unit stands, and a body whose rear is 5 cm before the tips of its pins.
HERE = SE2(0.1, -0.2, 0.4)
IN_FRONT = HERE @ SE2(0.118 + 0.05 + 0.1, 0.0, 0.0)


class Onwards:
    """A long-distance phase of somebody's own: it drives straight on, for good or for a while."""

    def __init__(self, setup: AssemblySetup, steps: float = math.inf) -> None:
        self._left = steps

    def reset(self, reason: str) -> None:
        self._left = 0.0

    def step(self, senses: Observation) -> Twist | None:
        self._left -= 1.0
        return AHEAD if self._left >= 0.0 else None


class StraightOn:
    """A controller of somebody's own: it drives straight on."""

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
                "assembly": {"name": f"{__name__}:Onwards", "params": assembly},
                "docking": {"name": f"{__name__}:StraightOn"},
            },
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


class Robot:
    """The robot of that scene, and the messages that reach it: told, not simulated."""

    def __init__(self, X_WB: SE2, X_WC: SE2 = FAR, **assembly: Any) -> None:
        scene = _scene(**assembly)
        self.autonomy = Autonomy(scene, scene.plan[0])
        self.X_WD = X_WB @ scene.geometry("b").dock_frame("rear")
        self._standing = {"b": X_WB, "c": X_WC}
        self._tick = 0

    def step(self, X_WA: SE2, by_sight: SE2 | None = None) -> Action:
        """Tell where everybody is as seen from above, and where the unit is as it sees it, and ask."""
        self._tick += 1
        now = self._tick * DT_NS
        for name, X in {"a": X_WA, **self._standing}.items():
            self.autonomy.receive(GlobalPose(name, now, X, SURE))
        if by_sight is not None:
            exposure = Exposure("a/onboard", self._tick, now)
            self.autonomy.receive(PoseMeasurement(exposure, by_sight, SURE, (0.1, -0.1)))
        return self.autonomy.step(now)


@pytest.mark.parametrize("who", ["target", "third unit", "nobody"])
def test_on_its_way_a_unit_keeps_off_everybody_its_target_included(who: str) -> None:
    robot = {
        "target": lambda: Robot(IN_FRONT),
        "third unit": lambda: Robot(FAR @ SE2(1.0, 0.5), IN_FRONT),
        "nobody": lambda: Robot(FAR @ SE2(1.0, 0.5)),
    }[who]()
    for _ in range(5):
        action = robot.step(HERE)
        assert action.phase is Phase.ASSEMBLE
        assert 0.0 <= action.twist.v <= AHEAD.v
        assert (action.twist == AHEAD) is (who == "nobody")


@pytest.mark.parametrize("blocked", [False, True])
def test_while_it_docks_it_may_touch_its_target_and_nobody_else(blocked: bool) -> None:
    """The third unit stands across the lane, the pins nearly in the port."""
    beside = IN_FRONT @ SE2(-0.1, 0.13, math.radians(90.0)) if blocked else FAR
    robot = Robot(IN_FRONT, beside, steps=0)
    X_DU = robot.X_WD.inverse() @ HERE
    actions = [robot.step(HERE, X_DU) for _ in range(5)]
    assert actions[-1].phase is Phase.DOCK
    assert (actions[-1].twist == AHEAD) is not blocked


def _own(robot: Robot) -> SE2:
    situation = robot.autonomy.situation
    assert situation is not None
    return situation.own.X_WB


def _same(a: SE2, b: SE2, atol: float = 1e-3) -> None:
    apart = a.inverse() @ b
    np.testing.assert_allclose(apart.as_array(), 0.0, atol=atol)


def test_far_away_it_is_where_the_overhead_camera_sees_it_and_near_where_its_own_does() -> None:
    """The two cameras disagree by 3 cm and 5 deg; each is believed in its phases."""
    robot = Robot(HERE @ SE2(0.6, 0.0), steps=3)
    from_above = HERE @ SE2(0.0, 0.03, math.radians(5.0))
    X_DU = robot.X_WD.inverse() @ HERE
    phases = []
    for _ in range(10):
        before = phases[-1] if phases else Phase.ASSEMBLE
        phases.append(robot.step(from_above, X_DU).phase)
        _same(_own(robot), from_above if before in (Phase.ASSEMBLE, Phase.HAND_OVER) else HERE)
    assert {Phase.ASSEMBLE, Phase.DOCK} <= set(phases)


def test_what_it_sees_itself_is_put_before_the_target_that_is_seen_from_above() -> None:
    """Its own camera knows it before the port alone; where the port is, the overhead camera says."""
    robot = Robot(HERE @ SE2(0.6, 0.0), steps=0)
    X_DU = SE2(-0.4, 0.05, -0.1)
    for _ in range(3):
        action = robot.step(HERE, X_DU)
    assert action.phase is Phase.DOCK
    _same(_own(robot), robot.X_WD @ X_DU)
