"""A unit under way: its robot, its sensors, and the command link to its drive and its lock."""

from __future__ import annotations

from msrr_bullet.profiler import Profiler
from msrr_bullet.robot.interface import Robot
from msrr_bullet.sensors.schedule import NEVER_NS
from msrr_bullet.sensors.sensor_suite import CameraSensor, SensorSuite
from msrr_bullet.trial.environment import Environment
from msrr_scenes.messages import Action, Phase, Twist
from msrr_scenes.specs.plan import DockStep


class UnitRunner:
    """Lets the robot of a unit sense and act; ``action`` is its last decision."""

    def __init__(self, environment: Environment, unit: str, robot: Robot, profiler: Profiler) -> None:
        """Prepare a unit that has no sensors at work yet."""
        simulation = environment.simulation
        self._scene, self._plant, self._devices = simulation.scene, simulation.plant, environment.devices
        self._robot, self._profiler = robot, profiler
        self._link = environment.devices.links[unit]
        self._sensors: SensorSuite | None = None
        self._has_target = False
        self.unit = unit
        self.action = Action(self._plant.now_ns(), Phase.ASSEMBLE, attempt=1)

    @property
    def running(self) -> bool:
        """Whether the sensors are at work."""
        return self._sensors is not None

    @property
    def ever_detected(self) -> bool:
        """Whether the target has been detected since the sensors were started."""
        return self._sensors is not None and self._sensors.ever_detected

    @property
    def next_ns(self) -> float:
        """Time at which the unit senses or gets a command next [ns]."""
        return min(self._sensors.next_ns if self._sensors else NEVER_NS, self._link.next_ns)

    def start(self, step: DockStep | None, cameras: list[CameraSensor]) -> None:
        """Start the sensors and the cameras that the unit can read; the step is None without a target."""
        self._has_target = self._has_target or step is not None
        encoders = self._devices.encoders[self.unit]
        self._sensors = SensorSuite(
            self._scene, self.unit, step, self._plant, encoders, cameras, self._profiler
        )

    def stop(self) -> None:
        """Stop the unit and its sensors."""
        self._plant.command(self.unit, Twist())
        self._sensors = None

    def sense(self, now_ns: int) -> None:
        """Make the measurements that are due and deliver the messages that have arrived."""
        if self._sensors is not None:
            self._sensors.tick(now_ns, self._robot)

    def decide(self, now_ns: int) -> Action:
        """Let the robot decide at a control instant; return the decision before."""
        before = self.action
        with self._profiler("control"):
            self.action = self._robot.step(now_ns)
        self._link.send(self.action)
        return before

    def actuate(self, now_ns: int) -> None:
        """Command drive and lock as the newest action says that has arrived over the link."""
        action = self._link.arrived(now_ns)
        if action is not None:
            self._plant.command(self.unit, action.twist)
            if self._has_target:  # else the port was never made ready for any
                self._plant.set_lock(self.unit, action.lock)
