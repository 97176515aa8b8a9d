"""The devices of all units in one trial: cameras, wheel encoders and command links."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from msrr_bullet.built_poses import camera_pose, overhead_camera_pose
from msrr_bullet.profiler import Profiler
from msrr_bullet.render import RenderContext, Renderer, build_renderer
from msrr_bullet.sensors.calibrated_sight import OnboardSight, OverheadSight
from msrr_bullet.sensors.camera import Camera
from msrr_bullet.sensors.camera_motion import MotionSensor
from msrr_bullet.sensors.camera_sensors import RenderedCameraSensor
from msrr_bullet.sensors.command_link import CommandLink
from msrr_bullet.sensors.frame_sequence import FrameSequence
from msrr_bullet.sensors.localisation_error import LocalisationError
from msrr_bullet.sensors.parametric_cameras import ParametricOnboardCamera, ParametricOverheadCamera
from msrr_bullet.sensors.radio import Radio
from msrr_bullet.sensors.sensor_suite import CameraSensor
from msrr_bullet.sensors.wheel_encoders import WheelEncoders
from msrr_bullet.simulation.simulation import Simulation
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.as_built import BuiltCamera
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import NS_PER_S, OVERHEAD, Pixels, onboard_camera
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.faults import EncoderStuck
from msrr_scenes.specs.mission import RadioSpec
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec
from msrr_scenes.specs.spec import Choice


class Devices:
    """The devices of a trial, which keep their state from one step of the plan to the next.

    Encoders go on counting, frames are numbered through and no sequence of random numbers starts again.
    Encoders and links are by unit; there is no radio without a base station.
    """

    def __init__(self, simulation: Simulation, seed: int) -> None:
        """Build the encoders and links of all units; a camera is built when a step first needs it."""
        scene = simulation.scene
        self._simulation = simulation
        self._seed = seed
        self.encoders = {
            unit: WheelEncoders(
                unit,
                scene.odometry,
                stream(seed, f"unit/{unit}/odometry"),
                (_stuck_from_ns(scene, unit, "left"), _stuck_from_ns(scene, unit, "right")),
            )
            for unit in scene.units
        }
        self.links = {
            unit: CommandLink(scene.link, stream(seed, f"unit/{unit}/link")) for unit in scene.units
        }
        spec = scene.radio or RadioSpec()
        self.radio = Radio(spec, tuple(scene.units), seed) if scene.coordinated else None
        self._cameras: dict[str, Camera] = {}
        self._renderers: list[tuple[Choice, int, Renderer]] = []
        self._frames: dict[str, FrameSequence] = {}
        self._generators: dict[str, np.random.Generator] = {}
        self._localisation: LocalisationError | None = None

    def cameras(self, step: DockStep, X_DU: Callable[[], SE2], profiler: Profiler) -> list[CameraSensor]:
        """Return the cameras of a unit on its own: overhead, if the scene has one, and onboard.

        ``X_DU`` returns the true pose of the docking unit in the dock frame.
        """
        onboard = self.onboard(step, X_DU, profiler)
        if self._simulation.scene.cameras.overhead is None:
            return [onboard]
        return [self.overhead(profiler, step), onboard]

    def onboard(self, step: DockStep, X_DU: Callable[[], SE2], profiler: Profiler) -> CameraSensor:
        """Return the onboard camera of the unit of a step; see :meth:`cameras`."""
        if self._simulation.scene.perception == "parametric":
            return self._parametric_onboard(step, X_DU)
        return self._onboard(step, profiler)

    def overhead(self, profiler: Profiler, step: DockStep | None = None) -> CameraSensor:
        """Return the overhead camera: that of a base station, or of a unit on its own in a step."""
        if self._simulation.scene.perception == "parametric":
            return self._parametric_overhead()
        return self._overhead(step, profiler)

    def _onboard(self, step: DockStep, profiler: Profiler) -> CameraSensor:
        scene, plant, unit = self._simulation.scene, self._simulation.plant, step.unit
        built = self._simulation.built
        X_UC = optical_pose(camera_pose(scene, built, unit))
        camera = self._camera(
            onboard_camera(unit),
            scene.cameras.onboard,
            built.units[unit].camera,
            lambda: plant.pose3(unit) @ X_UC,
            carrier=unit,
        )
        return RenderedCameraSensor(camera, profiler)

    def _overhead(self, step: DockStep | None, profiler: Profiler) -> CameraSensor:
        scene = self._simulation.scene
        built, spec = self._simulation.built, scene.cameras.overhead
        assert spec is not None, "the scene has an overhead camera"
        assert built.overhead is not None, "an overhead camera was built"
        X_WC = overhead_camera_pose(scene, built)
        camera = self._camera(OVERHEAD, spec, built.overhead, lambda: X_WC)
        if step is None or spec.localisation == type(spec.localisation)():
            return RenderedCameraSensor(camera, profiler)
        error = self._localisation = self._localisation or LocalisationError(spec.localisation, self._seed)
        model, own = OverheadModel.from_scene(scene, (step.unit, step.target_unit)), step.unit
        return RenderedCameraSensor(camera, profiler, lambda detections: error.apply(detections, model, own))

    def _parametric_onboard(self, step: DockStep, X_DU: Callable[[], SE2]) -> CameraSensor:
        scene, built = self._simulation.scene, self._simulation.built
        name, spec = onboard_camera(step.unit), scene.cameras.onboard
        return ParametricOnboardCamera(
            scene,
            step,
            X_DU,
            self._errors(name),
            self._frames_of(name, spec, built.units[step.unit].camera),
            None if built.is_as_designed else OnboardSight(scene, built, step),
        )

    def _parametric_overhead(self) -> CameraSensor:
        scene, built = self._simulation.scene, self._simulation.built
        spec = scene.cameras.overhead
        assert spec is not None, "the scene has an overhead camera"
        assert built.overhead is not None, "an overhead camera was built"
        return ParametricOverheadCamera(
            scene,
            spec,
            self._simulation.poses,
            lambda body: self._errors(OVERHEAD, body),
            self._frames_of(OVERHEAD, spec, built.overhead),
            None if built.is_as_designed else OverheadSight(scene, built),
        )

    def _camera(
        self,
        name: str,
        spec: CameraSpec,
        built: BuiltCamera,
        pose: Callable[[], SE3],
        carrier: str | None = None,
    ) -> Camera:
        if name not in self._cameras:
            world = self._simulation.world
            assert world is not None, "a simulation with images has a world"
            self._cameras[name] = Camera(
                name,
                spec,
                self._renderer(spec, world.client),
                pose,
                self._seed,
                self._simulation.scene.faults,
                built,
                MotionSensor(self._simulation, carrier),
            )
        return self._cameras[name]

    def _renderer(self, spec: CameraSpec, client: int) -> Renderer:
        """Return the renderer of a camera; cameras of one choice share it, for they see the same bodies."""
        for choice, samples, renderer in self._renderers:
            if (choice, samples) == (spec.renderer, spec.samples):
                return renderer
        renderer = _built_renderer(spec, client)
        self._renderers.append((spec.renderer, spec.samples, renderer))
        return renderer

    def _errors(self, camera: str, *body: str) -> np.random.Generator:
        """Return the generator of the errors of a parametric camera, or of what it measures of one body.

        All steps share the sequence.
        """
        name = "/".join(("camera", camera, "parametric", *body))
        return self._generators.setdefault(name, stream(self._seed, name))

    def _frames_of(self, camera: str, spec: CameraSpec, built: BuiltCamera) -> FrameSequence:
        """Return the frames of a parametric camera; all steps share the sequence."""
        if camera not in self._frames:
            faults = self._simulation.scene.faults
            self._frames[camera] = FrameSequence(camera, spec, built, self._seed, faults)
        return self._frames[camera]


class _FailedRenderer:
    """Stands for a renderer that could not be built, so that the trial ends as with any other failure."""

    def __init__(self, error: ProgramFailedError) -> None:
        self._error = error

    def render(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
        raise self._error

    def render_instants(self, *_: object) -> list[Pixels]:
        raise self._error


def _built_renderer(spec: CameraSpec, client: int) -> Renderer:
    try:
        return build_renderer(spec.renderer, RenderContext(client, spec.samples))
    except ProgramFailedError as error:
        return _FailedRenderer(error)


def _stuck_from_ns(scene: Scene, unit: str, wheel: str) -> float:
    """Return the time from which on the encoder of a wheel is stuck; infinite if it is not."""
    stuck = (fault for fault in scene.faults if isinstance(fault, EncoderStuck))
    return min((f.from_s * NS_PER_S for f in stuck if (f.unit, f.wheel) == (unit, wheel)), default=math.inf)
