"""What Foxglove, Rerun and other clients show of a trial, derived message by message from the exact log.

Nothing reads these messages back: a replay and all figures use the exact ones beside them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np
from foxglove import Schema
from foxglove.messages import (
    FrameTransforms,
    ImageAnnotations,
    JointState,
    JointStates,
    PointsAnnotation,
    SceneEntity,
    SceneUpdate,
)

from msrr_bullet.log import foxglove, topics
from msrr_bullet.log.frame_tree import WORLD
from msrr_bullet.log.records import Event, FrameLinks, StartPoses, StepStart, TruePose
from msrr_control.shapes.bodies import ACTIVE_PORT
from msrr_control.tracks.track import track_of
from msrr_scenes.arrays import Array
from msrr_scenes.camera_lenses import camera_lenses
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    AssemblyPath,
    Detections,
    Localisation,
    LosObservation,
    LosStatus,
    PoseEstimate,
    WheelOdometry,
    carrier_of,
)
from msrr_scenes.messages.coordination import Authority
from msrr_scenes.specs.scene import Scene


class Shown(Protocol):
    """A message in a schema of Foxglove."""

    @staticmethod
    def get_schema() -> Schema:
        """Return the schema."""
        ...

    def encode(self) -> bytes:
        """Return the message in protobuf."""
        ...


#: A message with its topic and its time [ns].
Display = tuple[str, int, Shown]

#: Least time between two of what would otherwise come at every reading [ns].
_EVERY_NS = 100_000_000

#: Colours of units in turn, of obstacles, and of drawings, which colour-blind eyes can tell apart (Okabe and
#: Ito, Color Universal Design, 2008).
_UNITS = (0x56B4E9, 0x8FA3AD, 0x7FB8A4, 0xB7A6C9)
_OBSTACLE, _PATH, _GRANTED, _BELIEF = 0xB9A76A, 0x37424D, 0x0072B2, 0xE69F00
_DETECTION, _WINDOW = 0xD55E00, 0x56B4E9
_SIGHT = {LosStatus.SEEN: 0x009E73, LosStatus.PREDICTED: 0xF0E442}

#: Height of lines above the floor [m], and number of points of an ellipse.
_LIFT_M, _ELLIPSE = 0.003, 32

#: Radius of an ellipse in standard deviations: 95 % of a normal distribution in the plane lie inside.
_ELLIPSE_SIGMAS = math.sqrt(-2.0 * math.log(0.05))


class DisplayMessages:
    """Derives the messages for clients from the exact messages of one trial, which it gets in their order."""

    def __init__(self, scene: Scene) -> None:
        """Set up for the trial of a scene."""
        self._scene, self._cameras = scene, camera_lenses(scene)
        self._geometries = {unit: scene.geometry(unit) for unit in scene.units}
        self._waiting: dict[str, SE2] = {}  # obstacles that have not appeared
        self._sight: dict[str, LosObservation] = {}
        self._routes: dict[str, int] = {}
        self._ports: dict[str, str] = {}  # those to which the units dock: the frames of their estimates
        self._estimates: dict[str, tuple[str, PoseEstimate]] = {}  # with their frames
        self._last_ns: dict[tuple[type, str], int] = {}
        self._drawings: dict[str, dict[str, SceneEntity]] = {}  # by topic and name
        self._derive: dict[type, Callable[[str, int, Any], Iterator[Display]]] = {
            AssemblyPath: self._path,
            Authority: self._authority,
            Detections: self._detections,
            Event: self._event,
            FrameLinks: self._links,
            Localisation: self._localisation,
            LosObservation: self._los,
            PoseEstimate: self._estimate,
            StartPoses: self._starts,
            StepStart: self._step,
            TruePose: self._true_pose,
            WheelOdometry: self._wheels,
        }

    def start(self) -> Iterator[Display]:
        """Yield what clients have to know first and no exact message says: cameras, shapes of the units."""
        for name, lens in self._cameras.items():
            yield topics.calibration(name), 0, foxglove.camera_calibration(name, lens)
        units = {
            name: foxglove.solids_entity(0, name, geometry.solids, _shade(i))
            for i, (name, geometry) in enumerate(self._geometries.items())
        }
        yield self._drawn(topics.DRAWN_BODIES, 0, units)

    def of(self, topic: str, stamp_ns: int, message: object) -> Iterator[Display]:
        """Yield what is shown of an exact message; most are not shown."""
        derive = self._derive.get(type(message))
        if derive is not None:
            yield from derive(topic, stamp_ns, message)

    def _links(self, topic: str, stamp_ns: int, links: FrameLinks) -> Iterator[Display]:
        transforms = [foxglove.frame_transform(links.stamp_ns, a.parent, a.child, a.X) for a in links.links]
        yield topics.TRANSFORMS, stamp_ns, FrameTransforms(transforms=transforms)

    def _starts(self, topic: str, stamp_ns: int, starts: StartPoses) -> Iterator[Display]:
        self._waiting = {name: starts.poses[name] for name in self._scene.obstacles}
        yield from self._appear(stamp_ns)

    def _appear(self, stamp_ns: int) -> Iterator[Display]:
        """Yield the obstacles that have appeared by now."""
        for name in [n for n in self._waiting if 1e9 * self._scene.obstacles[n].appears_at_s <= stamp_ns]:
            spec, X_WB = self._scene.obstacles[name], self._waiting.pop(name)
            yield from self._moved(stamp_ns, name, X_WB)
            shape = foxglove.solids_entity(stamp_ns, name, [spec.solid], foxglove.colour(_OBSTACLE))
            yield self._drawn(topics.DRAWN_BODIES, stamp_ns, {name: shape})

    def _true_pose(self, topic: str, stamp_ns: int, pose: TruePose) -> Iterator[Display]:
        yield from self._moved(pose.stamp_ns, pose.name, pose.X_WB)
        if self._waiting:
            yield from self._appear(stamp_ns)

    def _moved(self, stamp_ns: int, body: str, X_WB: SE2) -> Iterator[Display]:
        transform = foxglove.frame_transform(stamp_ns, WORLD, body, X_WB)
        yield topics.TRANSFORMS, stamp_ns, FrameTransforms(transforms=[transform])

    def _wheels(self, topic: str, stamp_ns: int, wheels: WheelOdometry) -> Iterator[Display]:
        if self._is_due(wheels, wheels.unit, stamp_ns):
            drawn = self._geometries[wheels.unit].wheel_joints
            angles = zip(drawn, (wheels.left, wheels.right), strict=True)
            joints = [JointState(name=joint.name, position=joint.forward * angle) for joint, angle in angles]
            states = JointStates(timestamp=foxglove.timestamp(wheels.stamp_ns), joints=joints)
            yield topics.joint_states(wheels.unit), stamp_ns, states

    def _step(self, topic: str, stamp_ns: int, start: StepStart) -> Iterator[Display]:
        step = start.step(self._scene)
        if step is not None:
            self._ports[start.unit] = step.to
        yield from ()

    def _event(self, topic: str, stamp_ns: int, event: Event) -> Iterator[Display]:
        yield topics.LOG_LINES, stamp_ns, foxglove.log_line(event)

    def _estimate(self, topic: str, stamp_ns: int, estimate: PoseEstimate) -> Iterator[Display]:
        X, P = estimate.X_DU, estimate.covariance
        if not (np.isfinite(X.as_array()).all() and np.isfinite(P).all()):
            return  # the filter of somebody's own program has diverged
        unit = topics.unit_of(topic)
        if unit not in self._ports:
            return  # nobody has said where it docks
        frame = self._ports[unit]
        yield topics.shown_estimate(unit), stamp_ns, foxglove.pose_in_frame(estimate.stamp_ns, frame, X)
        self._estimates[unit] = frame, estimate
        if self._is_due(estimate, "", stamp_ns):
            ellipses = {f"{name}/estimate": _ellipse_line(name, *e) for name, e in self._estimates.items()}
            yield self._drawn(topics.DRAWN_ESTIMATES, stamp_ns, ellipses)

    def _los(self, topic: str, stamp_ns: int, los: LosObservation) -> Iterator[Display]:
        self._sight[topics.unit_of(topic)] = los
        yield from ()

    def _localisation(self, topic: str, stamp_ns: int, message: Localisation) -> Iterator[Display]:
        yield from self._detections(topic, stamp_ns, message.detections)

    def _detections(self, topic: str, stamp_ns: int, found: Detections) -> Iterator[Display]:
        camera, at_ns = found.exposure.camera, found.exposure.stamp_ns
        window, tag = foxglove.colour(_WINDOW), foxglove.colour(_DETECTION)
        points, texts, lens = [], [], self._cameras[camera]
        for read in found.windows:
            points.append(foxglove.line(at_ns, _outline(read), window, closed=True))
        for detected in found.tags:
            corners = lens.distorted(detected.corners)  # the image is that of the lens, and not the ideal one
            points.append(foxglove.line(at_ns, corners, tag, closed=True))
            texts.append(foxglove.label(at_ns, corners[0], str(detected.tag_id), tag))
        unit = carrier_of(camera)
        if unit is not None:
            points += self._sight_lines(unit, camera, at_ns)
        annotations = ImageAnnotations(timestamp=foxglove.timestamp(at_ns), points=points, texts=texts)
        yield topics.image_annotations(camera), stamp_ns, annotations

    def _sight_lines(self, unit: str, camera: str, stamp_ns: int) -> list[PointsAnnotation]:
        """Return the edges of the target as the robot knows them, as upright lines in the image."""
        los, lens = self._sight.get(unit), self._cameras[camera]
        if los is None or los.status not in _SIGHT:
            return []
        shade, ideal, lines = foxglove.colour(_SIGHT[los.status]), lens.camera, []
        for angle in (los.left, los.right):
            if abs(angle) >= lens.half_fov:
                continue
            column = ideal.cx - ideal.focal * math.tan(angle)
            upright = np.array([[column, row] for row in np.linspace(0.0, ideal.height - 1.0, 9)])
            seen = upright[lens.shows(upright)]
            lines.append(foxglove.line(stamp_ns, lens.distorted(seen), shade))
        return lines

    def _path(self, topic: str, stamp_ns: int, path: AssemblyPath) -> Iterator[Display]:
        name = f"{topics.unit_of(topic)}/path"
        line = _line(stamp_ns, name, WORLD, np.array(path.points).reshape(-1, 2), _PATH)
        yield self._drawn(topics.DRAWN_PATHS, stamp_ns, {name: line})

    def _authority(self, topic: str, stamp_ns: int, granted: Authority) -> Iterator[Display]:
        if not granted.legs or self._routes.get(granted.unit) == granted.route:
            return
        self._routes[granted.unit] = granted.route
        offset = self._geometries[granted.unit].control_offset(ACTIVE_PORT)
        track = track_of(granted.legs, SE2(*granted.legs[0].start), offset)
        name = f"{granted.unit}/route"
        line = _line(stamp_ns, name, WORLD, track.poses[:, :2], _GRANTED)
        yield self._drawn(topics.DRAWN_ROUTES, stamp_ns, {name: line})

    def _drawn(self, topic: str, stamp_ns: int, entities: dict[str, SceneEntity]) -> Display:
        """Return all that is drawn on a topic, with new entities by their names.

        Every message is whole, for a client that jumps in time gets the last one of each topic alone.
        """
        drawn = self._drawings.setdefault(topic, {})
        drawn.update(entities)
        return topic, stamp_ns, SceneUpdate(entities=list(drawn.values()))

    def _is_due(self, message: object, unit: str, stamp_ns: int) -> bool:
        key = type(message), unit
        if stamp_ns - self._last_ns.get(key, -_EVERY_NS) < _EVERY_NS:
            return False
        self._last_ns[key] = stamp_ns
        return True


def _shade(index: int) -> Any:
    return foxglove.colour(_UNITS[index % len(_UNITS)])


def _outline(w: Window) -> Array:
    x0, y0, x1, y1 = w.x - 0.5, w.y - 0.5, w.x_end - 0.5, w.y_end - 0.5
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def _line(
    stamp_ns: int, name: str, frame: str, points: Array, rgb: int, *, closed: bool = False
) -> SceneEntity:
    """Return a line just above the floor, through points of shape (N, 2) [m] in ``frame``."""
    raised = np.column_stack([points, np.full(len(points), _LIFT_M)])
    return foxglove.line_entity(stamp_ns, name, frame, raised, foxglove.colour(rgb), closed=closed)


def _ellipse_line(unit: str, frame: str, estimate: PoseEstimate) -> SceneEntity:
    """Return the 95 % ellipse of a position that is estimated in ``frame`` as a line."""
    points = _ellipse(estimate.X_DU, estimate.covariance)
    return _line(estimate.stamp_ns, f"{unit}/estimate", frame, points, _BELIEF, closed=True)


def _ellipse(X: SE2, P: Array) -> Array:
    """Return the outline of the 95 % ellipse of a position, shape (N, 2) [m]."""
    variances, axes = np.linalg.eigh(0.5 * (P[:2, :2] + P[:2, :2].T))
    angles = np.linspace(0.0, 2.0 * math.pi, _ELLIPSE, endpoint=False)
    radii = _ELLIPSE_SIGMAS * np.sqrt(np.maximum(variances, 0.0))
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.asarray([X.x, X.y] + (circle * radii) @ axes.T)
