"""The PyBullet world: floor, units and obstacles in one DIRECT client.

A world owns one client, which is closed at the end of the ``with`` block. The same scene, placement and
commands give the same bits in any process: PyBullet has no random numbers, all settings are made here, and
bodies are created in the order of the scene.
"""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from msrr_bullet.plant.plant import Vector
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.floor import add_floor, gravity
from msrr_bullet.simulation.obstacle_body import add_obstacle
from msrr_bullet.simulation.solver import configure_solver
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.unit_body import ROOT, UnitBody, load_unit
from msrr_scenes.as_built import AsBuilt, as_designed
from msrr_scenes.errors import GeometryError, MsrrError, UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene

#: A link higher than this above the floor cannot reach it, because wheels and casters keep the unit from
#: tipping [m]. A driving unit costs a fifth less when such links are not tested against the floor.
FLOOR_REACH_M = 0.01
#: Points of two parts farther apart than this are no contact [m]. PyBullet keeps points where parts have
#: touched until they are millimetres apart, and the solver takes as long for them as for true contacts.
CONTACT_DISTANCE_M = 5e-5

#: Most joints of a body of PyBullet: with one more it reports no pose of the body.
_MOST_JOINTS = 127

#: Position [m] and quaternion xyzw of a body in W.
_Place = tuple[tuple[float, float, float], tuple[float, float, float, float]]


class BulletWorld:
    """Floor, units and obstacles of a scene.

    The floor is a plane for contact only and has no visual mesh: the cameras composite it.

    Attributes:
        client: Physics client id of PyBullet, an argument of every PyBullet call.
        floor: Body id of the floor.
        obstacles: Body id of every obstacle that stands in the world now, by name.
    """

    def __init__(
        self,
        scene: Scene,
        placement: Placement,
        *,
        tags: TagVisuals | None = None,
        built: AsBuilt | None = None,
    ) -> None:
        """Build the world.

        ``tags`` adds tags to the visual shapes of units and obstacles, if it is given. ``built`` is what is
        not as the scene says, None if all is; ``tags`` have to be built the same.
        """
        self.scene = scene
        self.built = built or as_designed(scene)
        self._placement = placement
        self._tags = tags
        self.units: dict[str, UnitBody] = {}
        self.obstacles: dict[str, int] = {}
        self._held: dict[str, SE2] = {}  # of units that are taken to stay where they are
        self._planar: dict[str, SE2] = {}  # of the present tick, with those that are held
        # Where the units were when poses and frames of theirs were asked for last, and the answers.
        self._places: dict[str, tuple[_Place, SE2]] = {}
        self._frames: dict[tuple[str, SE3], tuple[_Place, tuple[Vector, Vector, Vector]]] = {}
        self._frames_in_unit: dict[tuple[str, SE3], tuple[list[float], ...]] = {}  # in the frame I of it
        # The next obstacle to appear is last; obstacles that appear together keep the order of the scene.
        self._waiting = sorted(
            ((spec.appears_at_s, name) for name, spec in reversed(scene.obstacles.items())),
            key=lambda entry: -entry[0],
        )
        self.client: int = pybullet.connect(pybullet.DIRECT)
        if self.client < 0:
            raise MsrrError("PyBullet opens no further DIRECT client; too many are open in this process")
        try:
            self._configure()
            self.floor = add_floor(self.client, self.built.floor, scene.arena)
            for name in scene.units:
                self._add_unit(name, placement.units[name])
            self.reveal(0.0)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> BulletWorld:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the client; a second call does nothing."""
        if self.client >= 0:
            with suppress(pybullet.error):  # at the end of the process the client may be gone already
                # What PyBullet has read of mesh files stays for the whole process, until it is told not to.
                for caching in (0, 1):
                    pybullet.setPhysicsEngineParameter(enableFileCaching=caching, physicsClientId=self.client)
                pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def step(self) -> None:
        """Advance the physics by one tick of 1 / ``scene.physics_hz``."""
        self._planar = self._held.copy()
        pybullet.stepSimulation(physicsClientId=self.client)

    def unit(self, name: str) -> UnitBody:
        """Return a unit by name; an unknown name lists the units."""
        try:
            return self.units[name]
        except KeyError:
            raise UnknownNameError("unit", name, self.units) from None

    def reveal(self, now_s: float) -> None:
        """Add the obstacles that have appeared by ``now_s`` [s] and are not in the world yet."""
        while self._waiting and self._waiting[-1][0] <= now_s:
            _, name = self._waiting.pop()
            self.obstacles[name] = self._add_obstacle(name)

    def pose3(self, name: str) -> SE3:
        """Return the true ``X_WU``: the middle of the axle on the ground, pitch and roll included."""
        unit = self.unit(name)
        position, quaternion = pybullet.getBasePositionAndOrientation(unit.body, physicsClientId=self.client)
        return SE3.from_quaternion_xyzw(position, quaternion) @ unit.X_IU

    def frame(self, name: str, X_UF: SE3) -> tuple[Vector, Vector, Vector]:
        """Return origin [m], x axis and y axis in W of a frame that is fixed to a unit; faster than poses."""
        unit = self.unit(name)
        place = pybullet.getBasePositionAndOrientation(unit.body, physicsClientId=self.client)
        known = self._frames.get((name, X_UF))
        if known is None or known[0] != place:
            known = self._frames[name, X_UF] = (place, self._frame_at(place, name, X_UF))
        return known[1]

    def _frame_at(self, place: _Place, name: str, X_UF: SE3) -> tuple[Vector, Vector, Vector]:
        in_unit = self._frames_in_unit.get((name, X_UF))
        if in_unit is None:
            X_IF = self.unit(name).X_IU @ X_UF
            in_unit = self._frames_in_unit[name, X_UF] = (X_IF.p.tolist(), *X_IF.R.T.tolist()[:2])
        (px, py, pz), (x, y, z, w) = place
        r00, r01, r02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)
        r10, r11, r12 = 2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
        r20, r21, r22 = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)
        (ox, oy, oz), x_axis, y_axis = (
            (r00 * a + r01 * b + r02 * c, r10 * a + r11 * b + r12 * c, r20 * a + r21 * b + r22 * c)
            for a, b, c in in_unit
        )
        return (px + ox, py + oy, pz + oz), x_axis, y_axis

    def pose(self, name: str) -> SE2:
        """Return the true ``X_WU`` in the plane, the same object until the unit has moved."""
        pose = self._planar.get(name)
        if pose is None:
            unit = self.unit(name)
            place = pybullet.getBasePositionAndOrientation(unit.body, physicsClientId=self.client)
            known = self._places.get(name)
            if known is None or known[0] != place:
                known = self._places[name] = (place, _pose_in_plane(unit, place))
            pose = self._planar[name] = known[1]
        return pose

    def hold(self, name: str) -> None:
        """Take a unit to stay where it is until :meth:`look`, and save PyBullet from being asked for it."""
        self._held[name] = self.pose(name)

    def look(self, name: str) -> bool:
        """Hold a unit no longer; return whether it has moved although it was held."""
        held = self._held.pop(name, None)
        self._planar.pop(name, None)
        return held is not None and self.pose(name) is not held

    def link_pose(self, name: str, link: str) -> SE3:
        """Return the true pose ``X_WL`` of a link of a unit, the wheels by their present angles."""
        unit = self.unit(name)
        # A link that is missing was welded, and to the root, because the wheels carry no other link.
        if link in unit.geometry.frames and unit.links.get(link, ROOT) == ROOT:
            return self.pose3(name) @ unit.geometry.frame(link)
        state = pybullet.getLinkState(
            unit.body, unit.link(link), computeForwardKinematics=True, physicsClientId=self.client
        )
        return SE3.from_quaternion_xyzw(state[4], state[5])

    def twist(self, name: str) -> Twist:
        """Return the true velocity of frame U, expressed in U: forward and counter-clockwise."""
        unit = self.unit(name)
        linear, angular = (
            np.array(a) for a in pybullet.getBaseVelocity(unit.body, physicsClientId=self.client)
        )
        X_WU = self.pose3(name)
        p_WI = (X_WU @ unit.X_IU.inverse()).p
        forward = X_WU.R[:, 0]
        v_WU = linear + np.cross(angular, X_WU.p - p_WI)
        return Twist(float(v_WU @ forward), float(angular[2]))

    def wheel_angles(self, name: str) -> tuple[float, float]:
        """Return the true angles of the left and the right wheel [rad]."""
        unit = self.unit(name)
        left, right = pybullet.getJointStates(unit.body, unit.wheels, physicsClientId=self.client)
        return left[0], right[0]

    def place(self, name: str, X_WU: SE2, wheels: tuple[float, float]) -> None:
        """Put a unit on the floor at ``X_WU`` and at rest, the wheels (left, right) at these angles [rad]."""
        unit = self.unit(name)
        self._planar.clear()
        self._held.pop(name, None)
        # PyBullet sets the pose of the centre of mass, not of the link frame.
        X_WI = SE3.from_se2(X_WU) @ unit.X_IU.inverse()
        pybullet.resetBasePositionAndOrientation(
            unit.body, X_WI.p.tolist(), X_WI.quaternion_xyzw().tolist(), physicsClientId=self.client
        )
        for joint, angle in zip(unit.wheels, wheels, strict=True):
            pybullet.resetJointState(unit.body, joint, angle, 0.0, physicsClientId=self.client)

    def _configure(self) -> None:
        pybullet.setGravity(*gravity(self.built.floor), physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / self.scene.physics_hz,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )
        configure_solver(self.client)

    def _add_unit(self, name: str, X_WU: SE2) -> None:
        urdf = self._tags.unit_urdf(name) if self._tags else None
        built = self.built.units[name]
        geometry = self.scene.geometry(name)
        unit = self.units[name] = load_unit(self.client, geometry, urdf, built)
        joints = len(unit.links) - 1
        if joints > _MOST_JOINTS:
            raise GeometryError(
                f"{geometry.urdf}: it has {joints} joints, and PyBullet takes {_MOST_JOINTS} of a robot. "
                "Fixed ones of links with the same <contact> as what carries them do not count; make joints "
                "fixed that a docking does not need"
            )
        self.place(name, X_WU, (0.0, 0.0))
        for link in unit.links.values():
            (_, _, bottom), _ = pybullet.getAABB(unit.body, link, physicsClientId=self.client)
            if bottom > FLOOR_REACH_M:
                pybullet.setCollisionFilterPair(
                    unit.body, self.floor, link, ROOT, 0, physicsClientId=self.client
                )
                # Wheels and casters roll, so that the points of theirs move with every tick.
                pybullet.changeDynamics(
                    unit.body,
                    link,
                    contactProcessingThreshold=CONTACT_DISTANCE_M,
                    physicsClientId=self.client,
                )
        if self._tags:
            self._tags.add_to_unit(self.client, unit.body, name)

    def _add_obstacle(self, name: str) -> int:
        spec, X_WB = self.scene.obstacles[name], self._placement.obstacles[name]
        body = add_obstacle(self.client, spec, X_WB)
        if self._tags:
            self._tags.add_to_obstacle(self.client, name, X_WB)
        return body


def _pose_in_plane(unit: UnitBody, place: _Place) -> SE2:
    """Return ``X_WU`` in the plane from the pose of the unit's inertial frame."""
    (px, py, _), (x, y, z, w) = place
    # Only the first two rows of R_WI are needed; with matrices this would take ten times as long.
    r00, r01, r02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)
    r10, r11, r12 = 2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
    ax, ay, az = unit.origin
    bx, by, bz = unit.forward
    return SE2(
        px + r00 * ax + r01 * ay + r02 * az,
        py + r10 * ax + r11 * ay + r12 * az,
        math.atan2(r10 * bx + r11 * by + r12 * bz, r00 * bx + r01 * by + r02 * bz),
    )
