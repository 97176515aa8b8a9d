"""Time series of one trial of the real loop, from the messages that the loop records."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from msrr_bullet.log import topics
from msrr_bullet.log.records import TruePose
from msrr_bullet.studies.docking_studies import docking_law
from msrr_bullet.studies.measures import SETTLED_M
from msrr_bullet.timeline.path_following_series import ControlInstant
from msrr_control.docking.controller import ControlInputs, law_inputs
from msrr_control.docking.corrected_law import CorrectedLawState
from msrr_control.docking.law import DockSetup
from msrr_control.feedback.visibility_cone import edge_angles
from msrr_control.kinematics.controlled_point import offset_point
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure, Phase, Pixels, seconds
from msrr_scenes.specs.scene import Scene

#: Tolerance of time comparisons [s], far less than a control period.
_ROUNDING_S = 1e-6


class SeriesRecorder:
    """A :class:`msrr_bullet.log.recorder.Recorder` that keeps the control instants of one unit."""

    def __init__(self, unit: str) -> None:
        """Record the robot of ``unit``."""
        self.instants: list[ControlInstant] = []
        self._action = topics.action(unit)
        self._estimate, self._los = topics.estimate(unit), topics.los(unit)
        self._assembly = topics.assembly(unit)

    def write(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Keep a message if it belongs to a control instant of the unit."""
        if topic == self._action:
            self.instants.append(ControlInstant(message))
            return
        if not self.instants or self.instants[-1].action.stamp_ns != stamp_ns:
            return
        instant = self.instants[-1]
        if topic == self._estimate:
            instant.estimate = message
        elif topic == self._los:
            instant.los = message
        elif topic == self._assembly:
            instant.assembly = message
        elif isinstance(message, TruePose):
            instant.true[message.name] = message.X_WB

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Ignore pixels."""

    def close(self) -> None:
        """Do nothing."""


@dataclass(frozen=True, eq=False)
class DockingSeries:
    """The last approach of one trial from the hand-over to the first contact of the pins; truth in frame D.

    An approach begins when the target has been found and the docking law takes over.

    Attributes:
        time: Time since the beginning of the approach, shape (T,) [s].
        pose: True axle pose, shape (T, 3).
        tip: True controlled point, shape (T, 2) [m].
        reference: Guidance trajectory, computed again from the estimates, shape (T, 2) [m]; NaN for a law
            that follows none.
        corrected: The same with the line-of-sight correction of C1 and C2, which other laws do not have.
        edges: True angles of both edges of the target during the whole of this approach and of those before
            it, shape (S, 2) [rad].
        command: Commanded speeds (v, w), shape (T, 2).
        twist: True speeds (v, w), shape (T, 2).
    """

    time: Array
    pose: Array
    tip: Array
    reference: Array
    corrected: Array
    edges: Array
    command: Array
    twist: Array

    @classmethod
    def of(cls, instants: list[ControlInstant], scene: Scene, until_s: float | None) -> DockingSeries | None:
        """Select the last approach of a trial; None if there was none.

        The pins first touched at ``until_s`` [s], or never. The guidance depends on estimates and line of
        sight alone, so that the law reproduces it from these.
        """
        step = scene.docks[-1]
        approaches = [i for i in instants if i.action.phase is Phase.DOCK]
        approaches = [i for i in approaches if {step.unit, step.target_unit} <= set(i.true)]
        if not approaches:
            return None
        attempt = approaches[-1].action.attempt
        earlier = [i for i in approaches if i.action.attempt != attempt]
        last = [i for i in approaches if i.action.attempt == attempt]
        # The pins may have touched in an earlier approach only; the last one then counts to its end.
        if until_s is not None and until_s >= seconds(last[0].action.stamp_ns):
            last = [i for i in last if seconds(i.action.stamp_ns) <= until_s]
        setup = DockSetup.of(scene, step)
        X_TD = scene.dock_frame(step)

        def poses(selected: list[ControlInstant]) -> Array:
            X_DU = [(i.true[step.target_unit] @ X_TD).inverse() @ i.true[step.unit] for i in selected]
            return np.array([X.as_array() for X in X_DU]).reshape(-1, 3)

        edges = edge_angles(np.concatenate([poses(earlier), poses(last)]), setup.los, setup.camera_offset)
        last = [i for i in last if i.estimate is not None]
        if not last:
            return None
        pose = poses(last)
        time = np.array([seconds(i.action.stamp_ns) for i in last])
        reference, corrected = _guidance(last, scene, setup)
        return cls(
            time=time - time[0],
            pose=pose,
            tip=offset_point(pose, setup.offset),
            reference=reference,
            corrected=corrected,
            edges=edges,
            command=np.array([[i.action.twist.v, i.action.twist.w] for i in last]),
            twist=_speeds(time, pose),
        )

    def measures(self) -> dict[str, float]:
        """Return settling time [s], infinite for an approach that never settled, and final errors [m].

        The settling time is the time from which on the tip stays near the guidance trajectory to the end of
        the approach. The final error is the largest of the last second, measured to the guidance trajectory
        and to the port's axis. A law that follows no trajectory has the error to the port alone.
        """
        in_window = self.time >= self.time[-1] - 1.0 - _ROUNDING_S
        to_port = {"port": float(np.abs(self.tip[in_window, 1]).max())}
        if np.isnan(self.reference).any():
            return to_port
        error = np.hypot(*(self.tip - self.reference).T)
        beyond = np.flatnonzero(error > SETTLED_M)
        first = int(beyond[-1]) + 1 if beyond.size else 0
        settling = float(self.time[first]) if first < len(error) else math.inf
        return {"settling": settling, "final": float(error[in_window].max()), **to_port}

    def kept_within(self, bound: float) -> bool:
        """Return whether both edges of the target stayed within ``bound`` [rad] in every approach."""
        return bool(np.abs(self.edges).max() <= bound)


def _speeds(time: Array, pose: Array) -> Array:
    """Return (v, w) from poses, shape (T, 3), by central differences, shape (T, 2)."""
    if len(time) < 2:
        return np.zeros((len(time), 2))
    dx, dy, w = np.gradient(np.column_stack([pose[:, :2], np.unwrap(pose[:, 2])]), time, axis=0).T
    yaw = pose[:, 2]
    return np.column_stack([dx * np.cos(yaw) + dy * np.sin(yaw), w])


def _guidance(instants: list[ControlInstant], scene: Scene, setup: DockSetup) -> tuple[Array, Array]:
    """Return the docking law's reference without and with its line-of-sight correction, (T, 2) each [m]."""
    law = docking_law(scene.control.docking, setup)
    state: Any = None
    points, corrected = [], []
    previous_ns = instants[0].action.stamp_ns - round(1e9 / setup.rate_hz)
    for instant in instants:
        now_ns, estimate = instant.action.stamp_ns, instant.estimate
        if estimate is None:
            continue
        dt = seconds(now_ns - previous_ns)
        sensed = law_inputs(ControlInputs(now_ns, dt, estimate, instant.los))
        state = law.start(sensed) if state is None else state
        _, state = law.step(state, sensed, dt)
        points.append(law.reference(state))
        shift = state.cone.shift if isinstance(state, CorrectedLawState) else 0.0
        corrected.append(points[-1] + shift)
        previous_ns = now_ns
    return np.array(points), np.array(corrected)
