"""The plant without contact: units move exactly as their kinematics say, and ports are idealised.

It shows what a control law does when only the limits of the drive restrict it. Only the mouth of the port
that is docked to is solid. All other bodies pass through each other, which the judge still notices.
"""

from __future__ import annotations

from typing import Protocol

from msrr_bullet.plant.kinematic_port import KinematicPort
from msrr_bullet.plant.plant import Plant
from msrr_scenes.as_built import AsBuilt, as_designed
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Twist, seconds
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


class Scenery(Protocol):
    """The bodies that cameras see, such as a PyBullet world that is never stepped."""

    def place(self, name: str, X_WU: SE2, wheels: tuple[float, float]) -> None:
        """Put a unit on the floor at ``X_WU`` with its wheels (left, right) at these angles [rad]."""
        ...

    def reveal(self, now_s: float) -> None:
        """Add the obstacles that have appeared by ``now_s`` [s]."""
        ...


class KinematicPlant(Plant):
    """A plant of ideal unicycles behind the drive limits of Zheng et al., eq. 3."""

    def __init__(
        self,
        scene: Scene,
        placement: Placement,
        world: Scenery | None = None,
        *,
        built: AsBuilt | None = None,
    ) -> None:
        """Place the units.

        ``world`` has the bodies that follow the units, for the cameras; None when no camera is rendered.
        ``built`` is what is not as the scene says; None if all is.
        """
        super().__init__(scene, built or as_designed(scene))
        self._world = world
        self._placed: dict[str, tuple[SE2, tuple[float, float]]] = {}  # of the world, by unit
        # Asking the scene means to look for the file of the URDF, which takes longer than a tick.
        self._geometries = {name: scene.geometry(name) for name in scene.units}
        self._poses = {name: placement.units[name] for name in scene.units}
        self._wheels = dict.fromkeys(scene.units, (0.0, 0.0))
        self._twists = dict.fromkeys(scene.units, Twist())
        # Of a unit that stood in the last tick: the speeds of its wheels, which rounding makes of its pose.
        self._standing: dict[str, tuple[float, float]] = {}
        self._ports: dict[str, KinematicPort] = {}
        self._plugged: set[tuple[str, str]] = set()

    def step(self) -> None:
        """Advance by one tick: drives, exact integration, ports."""
        dt = self._dt
        before = dict(self._poses)
        for name in self._scene.units:
            velocity, drivetrain = self._drive(name), self._drivetrains[name]
            if not drivetrain.ideal:
                velocity = drivetrain.motion(drivetrain.step(velocity, dt))
            if name in self._standing and not (velocity.v or velocity.w):
                continue  # the product would be this pose, bit for bit
            self._poses[name] = self._poses[name] @ SE2.exp(velocity.v * dt, 0.0, velocity.w * dt)
        constrained: set[str] = set()
        for name in self._ports:
            self._constrain(name, constrained)
        for name, X_WU in self._poses.items():
            stands = before[name] == X_WU
            rates = self._standing.get(name) if stands else None
            if rates is None:
                motion = (before[name].inverse() @ X_WU).log()
                self._twists[name] = Twist(float(motion[0]) / dt, float(motion[2]) / dt)
                # Wheels turn as far as their unit moves: their motors are too weak to slip against a port.
                rates = self._drivetrains[name].rolling(self._twists[name])
                if stands:
                    self._standing[name] = rates
                else:
                    self._standing.pop(name, None)
            left, right = (angle + rate * dt for angle, rate in zip(self._wheels[name], rates, strict=True))
            self._wheels[name] = left, right
        self.tick += 1
        for port in self._ports.values():
            port.step(dt)
        if self._world is not None:
            for name, X_WU in self._poses.items():
                placed = X_WU, self._wheels[name]
                if self._placed.get(name) != placed:
                    self._world.place(name, *placed)
                    self._placed[name] = placed
            self._world.reveal(seconds(self.now_ns()))

    def pose(self, unit: str) -> SE2:
        """Return the true ``X_WU``."""
        self._check_unit(unit)
        return self._poses[unit]

    def pose3(self, unit: str) -> SE3:
        """Return the true ``X_WU``, level on the floor."""
        return SE3.from_se2(self.pose(unit))

    def wheel_angles(self, unit: str) -> tuple[float, float]:
        """Return the true angles of the left and the right wheel [rad]."""
        self._check_unit(unit)
        return self._wheels[unit]

    def twist(self, unit: str) -> Twist:
        """Return the mean velocity of the unit during the last tick."""
        self._check_unit(unit)
        return self._twists[unit]

    def set_plug(self, unit: str, port: str, present: bool) -> None:
        """Plug the holes of a passive port, or clear them."""
        self._check_unit(unit)
        (self._plugged.add if present else self._plugged.discard)((unit, port))
        for mechanism in self._ports.values():
            if (mechanism.dock_step.target_unit, mechanism.dock_step.target_port) == (unit, port):
                mechanism.plugged = present

    def is_plugged(self, unit: str, port: str) -> bool:
        """Return whether something plugs the holes of a passive port now."""
        return (unit, port) in self._plugged

    def _build_mechanism(self, step: DockStep) -> KinematicPort:
        own, target = self._geometries[step.unit], self._geometries[step.target_unit]
        X_TU = self.pose(step.target_unit).inverse() @ self.pose(step.unit)
        travel = self._switch_travel(step)
        port = KinematicPort(step, own, target, self._scene.lock, X_TU, travel)
        port.plugged = (step.target_unit, step.target_port) in self._plugged
        self._ports[step.unit] = port
        return port

    def _constrain(self, name: str, constrained: set[str]) -> None:
        """Constrain a docking unit by its port, after the unit that it docks to has been constrained."""
        port = self._ports.get(name)
        if port is None or name in constrained:
            return
        constrained.add(name)
        self._constrain(port.dock_step.target_unit, constrained)
        self._poses[name] = port.constrain(self._poses[name], self._poses[port.dock_step.target_unit])
