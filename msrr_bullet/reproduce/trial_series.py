"""Time series of one trial of the real loop, from what the loop tells its recorder."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from msrr_bullet.log import topics
from msrr_bullet.log.records import TruePose
from msrr_bullet.studies.close_studies import docking_law
from msrr_bullet.timeline.path_following_series import Instant
from msrr_control.docking.controller import ControlInputs, sense
from msrr_control.docking.law import DockSetup
from msrr_control.feedback.visibility_cone import edge_angles
from msrr_control.kinematics.offset_point import offset_point
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure, Phase, Pixels, seconds
from msrr_scenes.specs.scene import Scene

#: Far less than a control period [s]: an instant that is to the rounding a window before the end is in it.
_ROUNDING_S = 1e-6


class SeriesRecorder:
    """Keeps the control instants of the last step of a plan; a :class:`msrr_bullet.log.recorder.Recorder`."""

    def __init__(self, unit: str) -> None:
        """Listen to the robot ``unit``."""
        self.instants: list[Instant] = []
        self._action = topics.action(unit)
        self._estimate, self._los = topics.estimate(unit), topics.los(unit)
        self._assembly = topics.assembly(unit)

    def write(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Take in a message."""
        if topic == self._action:
            self.instants.append(Instant(message))
            return
        if not self.instants or self.instants[-1].action.stamp_ns != stamp_ns:
            return
        now = self.instants[-1]
        if topic == self._estimate:
            now.estimate = message
        elif topic == self._los:
            now.los = message
        elif topic == self._assembly:
            now.assembly = message
        elif isinstance(message, TruePose):
            now.true[message.name] = message.X_WB

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Pixels are of no interest here."""

    def close(self) -> None:
        """Do nothing."""


@dataclass(frozen=True, eq=False)
class CloseSeries:
    """The last approach of one trial, truth in D; from the hand-over to the first contact of the pins.

    An approach begins when the target has been found and the docking law takes over.

    Attributes:
        time: From its beginning, shape (T,) [s].
        pose: True axle pose, shape (T, 3).
        tip: True controlled point, shape (T, 2) [m].
        reference: The guidance trajectory, worked out again from the estimates, shape (T, 2) [m].
        edges: True angles of both edges of the target during this approach and those before it, each to its
            end, shape (S, 2) [rad].
        command: (v, w), shape (T, 2).
    """

    time: Array
    pose: Array
    tip: Array
    reference: Array
    edges: Array
    command: Array

    @classmethod
    def of(cls, instants: list[Instant], scene: Scene, until_s: float | None) -> CloseSeries | None:
        """Select the last approach; None if there was none.

        The guidance depends on estimates and line of sight alone, so the law gives it again from these.
        """
        step = scene.plan[-1]
        way = [i for i in instants if i.action.phase is Phase.DOCK]
        way = [i for i in way if {step.unit, step.target_unit} <= set(i.true)]
        if not way:
            return None
        last = way[-1].action.attempt
        earlier = [i for i in way if i.action.attempt != last]
        run = [i for i in way if i.action.attempt == last]
        # The pins may have touched in an earlier approach only; this one then counts to its end.
        if until_s is not None and until_s >= seconds(run[0].action.stamp_ns):
            run = [i for i in run if seconds(i.action.stamp_ns) <= until_s]
        setup = DockSetup.of(scene, step)
        X_TD = scene.geometry(step.target_unit).dock_frame(step.target_port)

        def poses(of: list[Instant]) -> Array:
            X_DU = [(i.true[step.target_unit] @ X_TD).inverse() @ i.true[step.unit] for i in of]
            return np.array([X.as_array() for X in X_DU]).reshape(-1, 3)

        seen = edge_angles(np.concatenate([poses(earlier), poses(run)]), setup.los, setup.camera_offset)
        run = [i for i in run if i.estimate is not None]
        if not run:
            return None
        pose = poses(run)
        time = np.array([seconds(i.action.stamp_ns) for i in run])
        return cls(
            time=time - time[0],
            pose=pose,
            tip=offset_point(pose, setup.offset),
            reference=_guidance(run, scene, setup),
            edges=seen,
            command=np.array([[i.action.twist.v, i.action.twist.w] for i in run]),
        )

    def measures(self, settled_m: float, window_s: float = 1.0) -> dict[str, float]:
        """Return settling time [s], infinite for an approach that never settled, and final error [m].

        The time is that from which on the tip stays near the guidance trajectory to the end of the approach.

        Args:
            settled_m: Distance of the tip from the guidance trajectory below which it counts as settled [m].
            window_s: The final error is the largest one in this time before the end [s].
        """
        off = np.hypot(*(self.tip - self.reference).T)
        late = self.time >= self.time[-1] - window_s - _ROUNDING_S
        beyond = np.flatnonzero(off > settled_m)
        first = int(beyond[-1]) + 1 if beyond.size else 0
        settling = float(self.time[first]) if first < len(off) else math.inf
        return {"settling": settling, "final": float(off[late].max())}

    def kept_within(self, bound: float) -> bool:
        """Say whether both edges of the target stayed within ``bound`` [rad] in every approach."""
        return bool(np.abs(self.edges).max() <= bound)


def _guidance(run: list[Instant], scene: Scene, setup: DockSetup) -> Array:
    law = docking_law(scene.control.docking, setup)
    state: Any = None
    points = []
    then = run[0].action.stamp_ns - round(1e9 / setup.rate_hz)
    for instant in run:
        now, estimate = instant.action.stamp_ns, instant.estimate
        if estimate is None:
            continue
        dt = seconds(now - then)
        sensed = sense(ControlInputs(now, dt, estimate, instant.los))
        state = law.start(sensed) if state is None else state
        _, state = law.step(state, sensed, dt)
        points.append(law.reference(state))
        then = now
    return np.array(points)
