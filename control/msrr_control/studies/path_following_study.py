"""Hundreds of unicycle trials of the long-distance phase under any law, in one call."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from msrr_control.kinematics.offset_point import offset_point
from msrr_control.kinematics.unicycle import drive, moved_on, roll, slipped
from msrr_control.path_following.law import PathFollowingLaw, State
from msrr_control.path_following.path import Path
from msrr_control.path_following.tracking import Obstacles
from msrr_control.path_following.walls import WallSpec, encounter, side_wall
from msrr_control.studies import metrics
from msrr_control.studies.docking_study import Disturbance
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import NonNegative, Positive, Spec
from msrr_scenes.specs.vehicle import LimitsSpec

Span = tuple[float, float]


class PathFollowingStartSet(Spec):
    """A set of circular paths, starts and obstacles; everything is uniform.

    Attributes:
        radius_m: Radius of the arc.
        sweep_deg: Its angle; left and right turns are equally likely.
        lead_in_m: Length of the straight line behind it.
        error_m: Half-width of the start error along each axis.
        error_deg: Half-width of the start error of the heading.
        obstacle_m: Radius of the obstacle; None for none.
        beside_m: Half-width of the obstacle's distance from the path.
        after_start_m: The obstacle is no nearer to the start of the path than this,
        before_end_m: and no nearer to the end of the arc than this.
        body_half_width_m: Of the unit.
    """

    radius_m: Span = (1.0, 1.4)
    sweep_deg: Span = (100.0, 140.0)
    lead_in_m: Positive = 0.3
    error_m: NonNegative = 0.02
    error_deg: NonNegative = 20.0
    obstacle_m: Positive | None = 0.08
    beside_m: NonNegative = 0.05
    after_start_m: Positive = 0.7
    before_end_m: Positive = 1.0
    body_half_width_m: Positive = Field(default=0.10)


@dataclass(frozen=True, eq=False)
class PathFollowingStudyResult:
    """Truth of every step of every trial.

    Attributes:
        time: Shape (steps,) [s].
        pose: Axle pose, shape (steps, trials, 3).
        tip: Controlled point, shape (steps, trials, 2) [m].
        desired: Desired point, shape (steps, trials, 2) [m].
        command: (v, w), shape (steps, trials, 2).
        twist: Speeds behind the drive's limits, shape (steps, trials, 2).
        walled: When a wall stood, shape (steps, trials).
        arc_end: When the desired point ended the arc, shape (trials,) [s].
        obstacle: Middle of the obstacle, shape (trials, 2) [m].
        path: What was to be followed, of leading shape (trials,).
    """

    time: Array
    pose: Array
    tip: Array
    desired: Array
    command: Array
    twist: Array
    walled: NDArray[np.bool_]
    arc_end: Array
    obstacle: Array
    path: Path

    def deviation(self) -> Array:
        """Distance between controlled and desired point, lag included, shape (steps, trials) [m]."""
        return metrics.deviation(self.tip, self.desired)

    def from_path(self) -> Array:
        """Distance of the controlled point from the path, which is a curve, shape (steps, trials) [m]."""
        return metrics.from_path(self.tip, self.path)

    def episode(self) -> NDArray[np.bool_]:
        """When the deviation is the obstacle's doing, shape (steps, trials)."""
        return metrics.obstacle_episode(self.time, self.deviation(), self.walled)

    def tracking_error(self) -> Array:
        """Steady tracking error about the end of the arc, shape (trials,) [m]."""
        return metrics.tracking_error(self.time, self.deviation(), self.arc_end, self.episode())

    def amplitude(self) -> Array:
        """Largest deviation from the desired point at the obstacle, shape (trials,) [m]."""
        return metrics.amplitude(self.deviation(), self.episode())

    def amplitude_from_path(self) -> Array:
        """Largest distance from the path at the obstacle, shape (trials,) [m]; no more than the amplitude."""
        return metrics.amplitude(self.from_path(), self.episode())

    def recovery_time(self) -> Array:
        """Time from the amplitude until the same deviation stays below 0.05 m, shape (trials,) [s]."""
        return metrics.recovery_time(self.time, self.deviation(), self.episode())

    def recovery_to_path(self) -> Array:
        """The same of the distance from the path, shape (trials,) [s]: without the time to catch up."""
        return metrics.recovery_time(self.time, self.from_path(), self.episode())

    def body_distance(self, half_length: float = 0.10, half_width: float = 0.10) -> Array:
        """Return the smallest distance of the body from the obstacle's middle, shape (trials,) [m]."""
        c, s = np.cos(self.pose[..., 2]), np.sin(self.pose[..., 2])
        dx, dy = self.obstacle[:, 0] - self.pose[..., 0], self.obstacle[:, 1] - self.pose[..., 1]
        along = np.maximum(np.abs(c * dx + s * dy) - half_length, 0.0)
        across = np.maximum(np.abs(c * dy - s * dx) - half_width, 0.0)
        nearest: Array = np.hypot(along, across).min(axis=0)
        return nearest


def draw_paths(starts: PathFollowingStartSet, trials: int, rng: np.random.Generator) -> tuple[Path, Array]:
    """Draw paths that start in the origin along x, and the middle of an obstacle on each, (trials, 2) [m]."""
    radius = rng.uniform(*starts.radius_m, trials)
    sweep = np.radians(rng.uniform(*starts.sweep_deg, trials))
    turn = rng.choice([-1.0, 1.0], trials)
    lengths = np.stack([radius * sweep, np.full(trials, starts.lead_in_m)], axis=-1)
    curvature = np.stack([turn / radius, np.zeros(trials)], axis=-1)
    path = Path(np.zeros((trials, 3)), curvature, lengths)
    s = rng.uniform(
        starts.after_start_m, np.maximum(path.arc_end - starts.before_end_m, starts.after_start_m)
    )
    beside = rng.uniform(-starts.beside_m, starts.beside_m, trials)
    at = path.at(s)
    across = np.stack([-np.sin(at.heading), np.cos(at.heading)], axis=-1)
    return path, at.point + beside[:, None] * across


def run_path_following_study(
    law: PathFollowingLaw[State],
    limits: LimitsSpec,
    rng: np.random.Generator,
    trials: int = 200,
    starts: PathFollowingStartSet | None = None,
    disturbance: Disturbance | None = None,
    *,
    walls: WallSpec | None = None,
    cruise_mps: float = 0.22,
    ramp_s: float = 1.5,
    offset: float = 0.10,
    rate_hz: float = 50.0,
    observer: Callable[[State], None] | None = None,
) -> PathFollowingStudyResult:
    """Simulate unicycles behind the nested limits of eq. 3 on circular paths past obstacles, all at once.

    Args:
        law: The law; its arrays have the leading shape (trials,).
        limits: Of the drive.
        rng: Draws paths, obstacles and start errors, then grips, then the noise.
        trials: How many.
        starts: What is drawn.
        disturbance: Noise and delay of the pose, slip; None is ideal.
        walls: When walls stand. They also tell when the deviation is the obstacle's doing, under a law
            that has no use for them.
        cruise_mps: Speed of the law's desired point, which says how long trials last.
        ramp_s: Its ramps.
        offset: l [m].
        rate_hz: Control rate.
        observer: Is shown the law's state of every step.
    """
    starts = starts if starts is not None else PathFollowingStartSet()
    wrong = disturbance if disturbance is not None else Disturbance()
    walls = walls if walls is not None else WallSpec()
    dt = 1.0 / rate_hz
    path, centre = draw_paths(starts, trials, rng)
    half_width = np.full(trials, walls.half_width(starts.obstacle_m or 0.0, starts.body_half_width_m))
    met = encounter(path, centre, half_width, walls)
    obstacles = Obstacles(centre[:, None], np.full((trials, 1), starts.obstacle_m is not None))
    half = np.array([starts.error_m, starts.error_m, np.radians(starts.error_deg)])
    pose = rng.uniform(-half, half, size=(trials, 3))
    pose[:, 0] -= offset  # the controlled point begins at s = 0
    grips = wrong.draw_grips(trials, rng) if wrong.slip else np.ones((trials, 2))
    counted, twist = pose, np.zeros((trials, 2))  # counted: where the wheels say that the unit is
    steps = int(np.ceil((float(path.length.max()) / cruise_mps + 2.0 * ramp_s + 3.0) / dt))
    sigma = np.array([wrong.sigma_xy_m, wrong.sigma_xy_m, np.radians(wrong.sigma_yaw_deg)])
    delayed: deque[tuple[Array, Array]] = deque(maxlen=round(wrong.delay_s / dt) + 1)
    poses = np.empty((steps, trials, 3))
    desired, commands, twists = (np.empty((steps, trials, 2)) for _ in range(3))
    walled = np.zeros((steps, trials), dtype=bool)
    arc_end = np.full(trials, np.nan)
    state: State | None = None
    for k in range(steps):
        delayed.append((counted, pose + sigma * rng.standard_normal(pose.shape)))
        was, seen = delayed[0]
        if wrong.compensated:
            seen = moved_on(seen, was, counted)
        state = law.start(seen, twist) if state is None else state
        wall = side_wall(met, met.side, offset_point(seen, offset), centre, half_width, walls)
        wall = wall._replace(active=wall.active & obstacles.present[:, 0])
        poses[k], twists[k], walled[k] = pose, twist, wall.active
        commands[k], state = law.step(state, path, seen, wall, obstacles, dt)
        desired[k] = state.desired
        if observer is not None:
            observer(state)
        arc_end = np.where(np.isnan(arc_end) & (state.pace.s >= path.arc_end), k * dt, arc_end)
        twist = drive(twist, commands[k], limits, dt)
        counted = roll(counted, twist, dt)
        pose = roll(pose, slipped(twist, grips, wrong.track_m), dt)
    return PathFollowingStudyResult(
        time=dt * np.arange(steps, dtype=np.float64),
        pose=poses,
        tip=offset_point(poses, offset),
        desired=desired,
        command=commands,
        walled=walled,
        arc_end=arc_end,
        obstacle=centre,
        path=path,
        twist=twists,
    )
