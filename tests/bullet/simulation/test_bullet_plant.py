"""The plant with contact: what the funnel, the pins and the wheels of the shipped unit do."""

import math
import subprocess
import sys

import numpy as np
import pytest

from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from msrr_scenes.random_streams import stream
from tests.bullet.conftest import bench, two_units


def test_any_approach_within_the_tolerance_seats():
    """Eight random approaches; in a larger sample 40 of 40 seated."""
    rng = stream(7, "approach")
    for _ in range(8):
        lateral, yaw = rng.uniform(-0.01, 0.01), math.radians(rng.uniform(-6.0, 6.0))
        port = str(rng.choice(["rear", "left", "right"]))
        with bench("bullet", SE2(-0.025, lateral, yaw), port) as b:
            b.drive(0.08, 2.0, until_seated=True)
            assert b.plant.switches("a") == (True, True), (port, lateral, yaw)


def test_the_docked_unit_is_not_dragged_away():
    """A docking unit presses with full torque: from behind, where the target is weakest, and from a side."""
    for port in ("rear", "left"):
        with bench("bullet", SE2(-0.02, 0.0, 0.0), port) as b:
            start = b.plant.pose("b")
            b.drive(0.1, 0.5)
            hit = b.plant.pose("b")
            b.drive(0.1, 1.0)
            pressed = hit.inverse() @ b.plant.pose("b")
            assert np.hypot(*(start.inverse() @ hit).translation) < 4e-3, port  # the impact at 0.1 m/s
            assert np.hypot(*pressed.translation) < 5e-4, port
            assert abs(pressed.yaw) < math.radians(0.1)


def test_well_aligned_pins_touch_when_they_reach_the_switches():
    with bench("bullet", SE2(-0.03, 0.0, 0.0)) as b:
        while not b.plant.pins_touch("a"):
            b.drive(0.05, 0.02)
            assert b.plant.tick < 480
        assert b.gap < 2e-3


def test_a_unit_stops_at_an_obstacle():
    scene = two_units(obstacles={"post": {"shape": "cylinder", "radius_m": 0.05}})
    placement = Placement({"a": SE2(), "b": SE2(0.0, 2.0, 0.0)}, {"post": SE2(0.25, 0.0, 0.0)})
    with BulletWorld(scene, placement) as world:
        plant = BulletPlant(world)
        plant.command("a", Twist(0.1, 0.0))
        for _ in range(360):
            plant.step()
        # The post stands between the pins; the inner edges of their tips, y = 0.035, meet it first.
        meets = 0.25 - math.sqrt(0.05**2 - 0.035**2) - 0.118
        assert plant.pose("a").x == pytest.approx(meets, abs=1e-3)


PROGRAM = """
import hashlib, struct, sys
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene
from msrr_scenes.geometry.se2 import SE2
scene = Scene.model_validate({"name": "t", "units": {"a": {"number": 1}, "b": {"number": 2}},
                              "plan": [{"unit": "a", "to": "b.rear"}]})
X_DP = SE2(-0.03, 0.006, -0.05)
X_WA = scene.geometry("b").dock_frame("rear") @ X_DP @ scene.geometry("a").port("front").inverse()
digest = hashlib.sha256()
with BulletWorld(scene, Placement({"a": X_WA, "b": SE2()}, {})) as world:
    plant = BulletPlant(world)
    plant.begin_dock(scene.plan[0])
    plant.command("a", Twist(0.08, 0.05))
    for k in range(480):
        plant.step()
        if k == 300:
            plant.set_lock("a", True)
        for unit in "ab":
            X = plant.pose(unit)
            digest.update(struct.pack("5d", X.x, X.y, X.yaw, *plant.wheel_angles(unit)))
        digest.update(repr((plant.switches("a"), plant.pins_touch("a"))).encode())
print(digest.hexdigest(), file=sys.stderr)
"""


def test_the_same_commands_give_the_same_bits_in_another_process():
    """Contact, funnel and lock included."""
    runs = [
        subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True).stderr
        for _ in range(2)
    ]
    assert len(runs[0].split()[-1]) == 64
    assert runs[0].split()[-1] == runs[1].split()[-1]
