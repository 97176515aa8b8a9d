"""A thousand unicycle trials in one call: how a law behaves before any picture is rendered."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from msrr_control.docking.law import DockingLaw, DockSetup, Sensed
from msrr_control.feedback.visibility_cone import edge_angles
from msrr_control.kinematics.offset_point import offset_point
from msrr_control.kinematics.unicycle import drive, moved_on, roll, slipped
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import NonNegative, Positive, Spec, Spread

State = TypeVar("State")


class StartSet(Spec):
    """A set of starts in front of the port; the same as a scene's ``PoseSpec`` with frame ``<unit>.<port>``.

    Attributes:
        distance_m: Between the two faces.
        spread: Half-widths of the uniform distribution of the front port about the docking axis.
    """

    distance_m: Positive = 0.70
    spread: Spread = Spread(x_m=0.05, y_m=0.10, yaw_deg=20.0)


CLOSE = StartSet()
CLOSE_HARD = StartSet(spread=Spread(x_m=0.05, y_m=0.15, yaw_deg=25.0))


class Disturbance(Spec):
    """What is wrong with the measurements of a study.

    Attributes:
        sigma_xy_m: Standard deviation of the measured position, drawn anew every step.
        sigma_yaw_deg: The same for the heading.
        sigma_bearing_deg: The same for each edge angle.
        delay_s: Age of pose and angles when the law gets them.
        compensated: The estimator moves each delayed pose forward by the odometry since its exposure, and
            the angles with it.
        slip: Largest share by which a wheel's path differs from what its encoder says; drawn uniformly for
            each wheel of each trial.
        track_m: Distance between the wheels.
    """

    sigma_xy_m: NonNegative = 0.0
    sigma_yaw_deg: NonNegative = 0.0
    sigma_bearing_deg: NonNegative = 0.0
    delay_s: NonNegative = Field(default=0.0, le=2.0)
    compensated: bool = True
    slip: NonNegative = Field(default=0.0, le=0.2)
    track_m: Positive = 0.13

    def draw_grips(self, trials: int, rng: np.random.Generator) -> Array:
        """Draw what each wheel (left, right) covers of its encoder's path, shape (trials, 2)."""
        grips: Array = 1.0 + self.slip * rng.uniform(-1.0, 1.0, (trials, 2))
        return grips


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
        reference: The law's guidance trajectory, shape (steps, trials, 2) [m].
        contact: Step at which the faces meet, -1 if they never do, shape (trials,).
        redrawn: Number of starts that were drawn again because the target lay outside the outer cone.
    """

    dt: float
    pose: Array
    command: Array
    twist: Array
    edges: Array
    tip: Array
    reference: Array
    contact: NDArray[np.int64]
    redrawn: int

    @property
    def docked(self) -> NDArray[np.bool_]:
        """The trials whose tip reached the face, shape (trials,)."""
        return self.contact >= 0

    def _until_contact(self) -> NDArray[np.bool_]:
        steps = np.arange(len(self.pose))[:, None]
        last = np.where(self.docked, self.contact, len(self.pose) - 1)
        return steps <= last[None, :]

    def error(self) -> Array:
        """Distance between tip and guidance trajectory, shape (steps, trials) [m]."""
        distance: Array = np.linalg.norm(self.tip - self.reference, axis=-1)
        return distance

    def settling_time(self, bound: float = 0.015) -> Array:
        """Return the time [s] from which on the error stays below ``bound`` [m] to the end, shape (trials,).

        The end is the contact, or that of the trial without one. Infinite where the error is above the bound
        there: such a trial never settles, and is no faster for having come to contact early.
        """
        until = self._until_contact()
        beyond = (self.error() > bound) & until
        steps = np.arange(len(self.pose))[:, None]
        first = np.max(np.where(beyond, steps + 1, 0), axis=0)
        return np.where(first < until.sum(axis=0), first * self.dt, np.inf)

    def final_error(self, window: float = 1.0) -> Array:
        """Return the largest error in the last ``window`` [s] before contact, shape (trials,) [m]."""
        steps = np.arange(len(self.pose))[:, None]
        before = np.where(self.docked, self.contact, len(self.pose) - 1)[None, :] - steps
        late = (before >= 0) & (before * self.dt <= window)
        largest: Array = np.max(np.where(late, self.error(), 0.0), axis=0)
        return largest

    def at_contact(self) -> tuple[Array, Array]:
        """Return lateral [m] and yaw [rad] error at contact of the docked trials."""
        trials = np.flatnonzero(self.docked)
        steps = self.contact[trials]
        return self.tip[steps, trials, 1], self.pose[steps, trials, 2]

    def in_cone(self, bound: float) -> NDArray[np.bool_]:
        """Say which trials kept both edges within ``bound`` [rad] from start to contact, shape (trials,)."""
        outside = (np.abs(self.edges).max(axis=-1) > bound) & self._until_contact()
        kept: NDArray[np.bool_] = ~outside.any(axis=0)
        return kept


def draw_starts(
    starts: StartSet, trials: int, setup: DockSetup, rng: np.random.Generator
) -> tuple[Array, int]:
    """Draw axle poses in D, shape (trials, 3), whose target lies inside the outer cone; count the redraws."""
    kept: list[Array] = []
    missing, redrawn = trials, 0
    half = np.array([starts.spread.x_m, starts.spread.y_m, np.radians(starts.spread.yaw_deg)])
    while missing:
        port = rng.uniform(-half, half, size=(missing, 3))
        port[:, 0] -= starts.distance_m
        port[:, :2] = offset_point(port, -setup.offset)
        fits = np.abs(edge_angles(port, setup.los, setup.camera_offset)).max(axis=-1) < setup.los.outer
        kept.append(port[fits])
        missing -= int(fits.sum())
        redrawn += int((~fits).sum())
    return np.concatenate(kept), redrawn


def run_study(
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
        trials: How many.
        starts: Where they start.
        disturbance: Noise and delay of what the law is told; None is ideal.
        duration: Simulated time of every trial [s].
        observer: Is shown the law's state of every step, for what only this law has.

    Returns:
        The trials' truth. The port is no obstacle here: a trial ends (for its figures) where the faces meet.
    """
    dt = 1.0 / setup.rate_hz
    wrong = disturbance if disturbance is not None else Disturbance()
    pose, redrawn = draw_starts(starts, trials, setup, rng)
    grips = wrong.draw_grips(trials, rng) if wrong.slip else np.ones((trials, 2))
    counted, twist = pose, np.zeros((trials, 2))  # counted: where the wheels say that the unit is
    steps = int(np.ceil(duration / dt))
    poses, edges = np.empty((steps, trials, 3)), np.empty((steps, trials, 2))
    commands, twists = np.empty((steps, trials, 2)), np.empty((steps, trials, 2))
    tips, references = np.empty((steps, trials, 2)), np.empty((steps, trials, 2))
    delayed: deque[tuple[Array, Array, Array]] = deque(maxlen=round(wrong.delay_s / dt) + 1)
    state: State | None = None
    for k in range(steps):
        poses[k], twists[k] = pose, twist
        edges[k] = _edges(pose, setup)
        tips[k] = offset_point(pose, setup.offset)
        delayed.append((counted, *_measured(pose, edges[k], wrong, rng)))
        was, seen, angles = delayed[0]
        if wrong.compensated:
            then, seen = seen, moved_on(seen, was, counted)
            turned = _edges(seen, setup) - _edges(then, setup)
            angles = angles + np.arctan2(np.sin(turned), np.cos(turned))
        sensed = Sensed(seen, angles, np.ones(trials), twist)
        state = law.start(sensed) if state is None else state
        commands[k], state = law.step(state, sensed, dt)
        references[k] = law.reference(state)
        if observer is not None:
            observer(state)
        twist = drive(twist, commands[k], setup.limits, dt)
        counted = roll(counted, twist, dt)
        pose = roll(pose, slipped(twist, grips, wrong.track_m), dt)
    reached = tips[..., 0] >= 0.0
    contact = np.where(reached.any(axis=0), reached.argmax(axis=0), -1)
    return StudyResult(dt, poses, commands, twists, edges, tips, references, contact, redrawn)


def _edges(pose: Array, setup: DockSetup) -> Array:
    return edge_angles(pose, setup.los, setup.camera_offset)


def _measured(pose: Array, edges: Array, wrong: Disturbance, rng: np.random.Generator) -> tuple[Array, Array]:
    sigma = np.array([wrong.sigma_xy_m, wrong.sigma_xy_m, np.radians(wrong.sigma_yaw_deg)])
    noisy = pose + sigma * rng.standard_normal(pose.shape)
    angles = edges + np.radians(wrong.sigma_bearing_deg) * rng.standard_normal(edges.shape)
    return noisy, angles
