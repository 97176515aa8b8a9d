"""The judge on units that stand tilted: it measures at the pins."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pybullet
import pytest

from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.simulation.simulation import Simulation
from msrr_bullet.simulation.world import BulletWorld
from msrr_bullet.trial.environment import LockedPairs
from msrr_bullet.trial.judge import Judge
from msrr_scenes.as_built import as_designed
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.outcome import Outcome
from msrr_scenes.placement.placement import Placement
from msrr_scenes.random_streams import stream
from tests.bullet.conftest import bench


def put(world: BulletWorld, name: str, X_WU: SE3) -> None:
    """Put a unit at a pose in space."""
    unit = world.unit(name)
    world.place(name, SE2(), world.wheel_angles(name))  # the world remembers where a unit is until it moves
    X_WI = X_WU @ unit.X_IU.inverse()
    pybullet.resetBasePositionAndOrientation(
        unit.body, X_WI.p, X_WI.quaternion_xyzw(), physicsClientId=world.client
    )


def judge_of(b: Any) -> Judge:
    """Return the judge of the pair on a bench."""
    simulation = Simulation(b.scene, as_designed(b.scene), Placement({}, {}), b.plant, b.plant.world)
    return Judge(simulation, ClearanceModel.from_scene(b.scene), LockedPairs(), b.scene.plan[0])


@pytest.mark.parametrize("pitch_deg", [-2.0, 2.0])
def test_a_tilted_pair_that_holds_its_pull_is_docked(pitch_deg: float) -> None:
    """Its faces are 3 mm apart, or 3 mm into each other, at the floor; its pins are in the seat."""
    with bench("bullet", SE2(-0.001, 0.0, 0.0), port="left") as b:
        world, geometry = b.plant.world, b.scene.geometry("a")
        # Held above the floor, where nothing presses the pair level.
        pybullet.setGravity(0.0, 0.0, 0.0, physicsClientId=world.client)
        above = SE3(p=np.array([0.0, 0.0, 0.02]))
        X_UP = SE3.from_se2(geometry.port("front"), geometry.pin_height)
        tilt = SE3.from_xyz_rpy([0.0, 0.0, 0.0], [0.0, math.radians(pitch_deg), 0.0])
        X_WA, X_WB = world.pose3("a"), world.pose3("b")
        put(world, "a", above @ X_WA @ X_UP @ tilt @ X_UP.inverse())
        put(world, "b", above @ X_WB)
        b.plant.set_lock("a", True)
        b.drive(0.0, b.scene.lock.close_time_s + 0.1)
        turned = math.acos(float((world.pose3("b").R.T @ world.pose3("a").R)[2, 2]))
        assert math.degrees(turned) == pytest.approx(2.0, abs=0.1), "the pair is tilted"
        judge = judge_of(b)
        seating = judge.seating()
        assert seating is not None
        assert seating.axial_gap_m == pytest.approx(0.001, abs=0.0005)
        engaged = b.plant.lock_engaged("a")
        passed = b.plant.pull_test("a")
        assert (engaged, passed) == (True, True)
        assert judge.verdict_docked(engaged).outcome is Outcome.DOCKED


def test_gap_and_offset_are_measured_at_the_pins_of_tilted_units() -> None:
    """Both units tilted in space at random: the pose of the pins against the holes is what was made."""
    rng = stream(0, "test_judge/tilted")
    with bench("bullet", SE2(-0.02, 0.0, 0.0)) as b:
        world, geometry = b.plant.world, b.scene.geometry("a")
        judge = judge_of(b)
        X_UP = SE3.from_se2(geometry.port("front"), geometry.pin_height)
        X_TD = SE3.from_se2(b.scene.geometry("b").dock_frame("rear"), geometry.pin_height)
        for _ in range(20):
            X_WB = SE3.from_xyz_rpy(
                rng.uniform(-0.3, 0.3, 3), rng.uniform([-0.05, -0.05, -3.0], [0.05, 0.05, 3.0])
            )
            gap, lateral = rng.uniform(-0.004, 0.03), rng.uniform(-0.01, 0.01)
            roll, pitch, yaw = rng.uniform(-0.05, 0.05, 3)
            X_DP = SE3.from_xyz_rpy([-gap, lateral, 0.001], [roll, pitch, yaw])
            put(world, "b", X_WB)
            put(world, "a", X_WB @ X_TD @ X_DP @ X_UP.inverse())
            port = judge.port_pose()
            assert (port.gap, port.lateral, port.yaw) == pytest.approx((gap, lateral, yaw), abs=1e-6)
