"""Thousands of unicycle trials of the close-range phase under any law, in one call."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrr_control.docking.law import DockingLaw, DockSetup, LawInputs, State
from msrr_control.feedback.visibility_cone import edge_angles
from msrr_control.kinematics.controlled_point import offset_point
from msrr_control.studies.disturbance import (
    RATES_HZ,
    TRIALS,
    Disturbance,
    DisturbedUnicycles,
    checked_commands,
)
from msrr_scenes.arrays import Array, read_only
from msrr_scenes.registry import require_in_range
from msrr_scenes.specs.spec import Length, Spec, Spread

#: Time before contact in which errors count as the final ones [s].
_LATE_S = 1.0


class StartSet(Spec):
    """A set of starts in front of the port, drawn as a scene's ``PoseSpec`` with frame ``<unit>.<port>``.

    Attributes:
        distance_m: Distance between the two faces.
        spread: Half-widths of the uniform distribution of the front port about the docking axis.
    """

    distance_m: Length = 0.70
    spread: Spread = Spread(x_m=0.05, y_m=0.10, yaw_deg=20.0)


CLOSE = StartSet()
CLOSE_HARD = StartSet(spread=Spread(x_m=0.05, y_m=0.15, yaw_deg=25.0))


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Truth of every step of every trial.

    Attributes:
        dt: Step [s].
        pose: Axle pose in D, shape (steps, trials, 3).
        command: Speeds the law asks for, shape (steps, trials, 2).
        twist: Speeds behind the drive's limits, shape (steps, trials, 2).
        edges: Line-of-sight angles, shape (steps, trials, 2) [rad].
        tip: Controlled point in D, shape (steps, trials, 2) [m].
        reference: The law's guidance trajectory, shape (steps, trials, 2) [m]; NaN if it follows none.
        contact: Step at which the controlled point is at the plane of the face, -1 if never, shape (trials,).
    """

    dt: float
    pose: Array
    command: Array
    twist: Array
    edges: Array
    tip: Array
    reference: Array
    contact: NDArray[np.int64]

    @property
    def at_face(self) -> NDArray[np.bool_]:
        """Whether the controlled point came to the plane of the face, wherever on it, shape (trials,)."""
        return self.contact >= 0

    def _until_contact(self) -> NDArray[np.bool_]:
        steps = np.arange(len(self.pose))[:, None]
        last = np.where(self.at_face, self.contact, len(self.pose) - 1)
        return steps <= last[None, :]

    def error(self) -> Array:
        """Return the distance of the controlled point from the guidance trajectory, (steps, trials) [m]."""
        distance: Array = np.linalg.norm(self.tip - self.reference, axis=-1)
        return distance

    def settling_time(self, bound: float = 0.015) -> Array:
        """Return the time [s] from which on the error stays below ``bound`` [m] to the end, shape (trials,).

        The end is the contact, or without one the end of the trial. The time is infinite where the error is
        above the bound at the end: such a trial never settles, and an early contact does not make it faster.
        It is NaN under a law that follows no trajectory.
        """
        until_contact = self._until_contact()
        above = (self.error() > bound) & until_contact
        steps = np.arange(len(self.pose))[:, None]
        first = np.max(np.where(above, steps + 1, 0), axis=0)
        settled = np.where(first < until_contact.sum(axis=0), first * self.dt, np.inf)
        return np.where(np.isnan(self.reference).any(axis=(0, 2)), np.nan, settled)

    def final_error(self) -> Array:
        """Return the largest error in the last second before contact, shape (trials,) [m].

        It is NaN under a law that follows no trajectory.
        """
        return self._largest_late(self.error())

    def port_error(self) -> Array:
        """Return the largest distance from the axis of the port in that time, shape (trials,) [m].

        It asks nothing of the law, so that any two laws can be compared by it.
        """
        return self._largest_late(np.abs(self.tip[..., 1]))

    def _largest_late(self, error: Array) -> Array:
        steps = np.arange(len(self.pose))[:, None]
        before = np.where(self.at_face, self.contact, len(self.pose) - 1)[None, :] - steps
        late = (before >= 0) & (before * self.dt <= _LATE_S)
        largest: Array = np.max(np.where(late, error, 0.0), axis=0)
        return largest

    def at_contact(self) -> tuple[Array, Array]:
        """Return lateral [m] and yaw [rad] error at contact of the trials that came to the face."""
        trials = np.flatnonzero(self.at_face)
        steps = self.contact[trials]
        return self.tip[steps, trials, 1], self.pose[steps, trials, 2]

    def in_cone(self, bound: float) -> NDArray[np.bool_]:
        """Return which trials kept both edges within ``bound`` [rad] until contact, shape (trials,)."""
        outside = (np.abs(self.edges).max(axis=-1) > bound) & self._until_contact()
        kept: NDArray[np.bool_] = ~outside.any(axis=0)
        return kept


def draw_starts(starts: StartSet, trials: int, setup: DockSetup, rng: np.random.Generator) -> Array:
    """Draw axle poses in D, (trials, 3), again where the target would lie outside the outer cone."""
    kept: list[Array] = []
    missing = trials
    half = np.array([starts.spread.x_m, starts.spread.y_m, np.radians(starts.spread.yaw_deg)])
    while missing:
        port = rng.uniform(-half, half, size=(missing, 3))
        port[:, 0] -= starts.distance_m
        port[:, :2] = offset_point(port, -setup.offset)
        fits = np.abs(edge_angles(port, setup.los, setup.camera_offset)).max(axis=-1) < setup.los.outer
        kept.append(port[fits])
        missing -= int(fits.sum())
    return np.concatenate(kept)


def run_docking_study(
    law: DockingLaw[State],
    setup: DockSetup,
    rng: np.random.Generator,
    trials: int = 1000,
    starts: StartSet = CLOSE,
    disturbance: Disturbance | None = None,
    duration: float = 15.0,
    observer: Callable[[State], None] | None = None,
) -> StudyResult:
    """Simulate unicycles behind the nested limits of eq. 3 under one law, all trials at once.

    Args:
        law: The law; its arrays have the leading shape (trials,).
        setup: Facts of the docking step.
        rng: Draws the starts, then the noise.
        trials: Number of trials.
        starts: Where they start.
        disturbance: Noise and delay of what the law is given; None is ideal.
        duration: Simulated time of every trial [s].
        observer: Called with the state of the law at every step, for figures that only this law has.

    Raises:
        ParameterError: There are no trials, or no time.
        ProgramFailedError: The law returned commands of another shape, or some that are not finite.

    Returns:
        The truth of the trials. The port is no obstacle: for its figures, a trial ends where the faces meet.
    """
    require_in_range({"trials": TRIALS, "duration": (1e-3, 1e5)}, locals())
    require_in_range({"rate_hz": RATES_HZ}, {"rate_hz": setup.rate_hz})
    dt = 1.0 / setup.rate_hz
    disturbance = disturbance if disturbance is not None else Disturbance()
    starting_poses = draw_starts(starts, trials, setup, rng)
    units = DisturbedUnicycles(starting_poses, disturbance, setup.limits, dt, rng)
    steps = int(np.ceil(duration / dt))
    poses = np.empty((steps, trials, 3))
    edges, commands, twists, tips, references = (np.empty((steps, trials, 2)) for _ in range(5))
    sigma_bearing = np.radians(disturbance.sigma_bearing_deg)
    edge_noise: deque[Array] = deque(maxlen=units.delay_steps + 1)
    state: State | None = None
    for k in range(steps):
        poses[k], twists[k] = units.pose, units.twist
        edges[k] = edge_angles(units.pose, setup.los, setup.camera_offset)
        tips[k] = offset_point(units.pose, setup.offset)
        late, measured = units.measure()
        edge_noise.append(sigma_bearing * rng.standard_normal(edges[k].shape))
        measured_edges = edge_angles(units.exposed, setup.los, setup.camera_offset) + edge_noise[0]
        if disturbance.compensated:
            turned = edge_angles(measured, setup.los, setup.camera_offset)
            turned -= edge_angles(late, setup.los, setup.camera_offset)
            measured_edges = measured_edges + np.arctan2(np.sin(turned), np.cos(turned))
        given = map(
            read_only, (measured, measured_edges, np.ones(trials), units.twist, np.array(units.age_s))
        )
        inputs = LawInputs(*given)
        state = law.start(inputs) if state is None else state
        command, state = law.step(state, inputs, dt)
        commands[k] = checked_commands(command, (trials, 2), law)
        references[k] = law.reference(state)
        if observer is not None:
            observer(state)
        units.advance(commands[k])
    reached = tips[..., 0] >= 0.0
    contact = np.where(reached.any(axis=0), reached.argmax(axis=0), -1)
    return StudyResult(dt, poses, commands, twists, edges, tips, references, contact)
