"""Hundreds of unicycle trials of the long-distance phase under any law, in one call."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from msrr_control.kinematics.controlled_point import offset_point
from msrr_control.path_following.law import PathFollowingLaw, State
from msrr_control.path_following.obstacle_forces import Obstacles
from msrr_control.path_following.path import PaceSpec, Path
from msrr_control.path_following.walls import WallSpec, find_encounter, side_wall
from msrr_control.studies import metrics
from msrr_control.studies.disturbance import (
    RATES_HZ,
    TRIALS,
    Disturbance,
    DisturbedUnicycles,
    checked_commands,
)
from msrr_scenes.arrays import Array, read_only
from msrr_scenes.registry import require_in_range
from msrr_scenes.specs.spec import Distance, Length, NonNegative, Positive, Spec, Turn
from msrr_scenes.specs.vehicle import LimitsSpec


def _ascends(span: tuple[float, float]) -> tuple[float, float]:
    if span[0] > span[1]:
        raise ValueError(f"{span[0]:g} comes before {span[1]:g}; name the lower end of the range first")
    return span


Span = Annotated[tuple[NonNegative, NonNegative], AfterValidator(_ascends)]
PositiveSpan = Annotated[tuple[Positive, Positive], AfterValidator(_ascends)]

#: Half the length and the width of the unit's body, a square about the axle [m].
HALF_BODY_M = 0.10


class PathFollowingStartSet(Spec):
    """A set of circular paths, starts and obstacles, all drawn from uniform distributions.

    Attributes:
        radius_m: Range of the arc's radius.
        sweep_deg: Range of the arc's angle; left and right turns are equally likely.
        lead_in_m: Length of the straight line behind the arc.
        error_m: Half-width of the start error along each axis.
        error_deg: Half-width of the start error of the heading.
        obstacle_m: Radius of the obstacle; None for none.
        beside_m: Half-width of the obstacle's distance from the path.
        after_start_m: Smallest distance along the path from its start to the obstacle.
        before_end_m: Smallest distance along the path from the obstacle to the end of the arc.
    """

    radius_m: PositiveSpan = (1.0, 1.4)
    sweep_deg: Span = (100.0, 140.0)
    lead_in_m: Length = 0.3
    error_m: Distance = 0.02
    error_deg: Turn = 20.0
    obstacle_m: Length | None = 0.08
    beside_m: Distance = 0.05
    after_start_m: Length = 0.7
    before_end_m: Length = 1.0


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
        walled: Whether a wall stood, shape (steps, trials).
        arc_end: Time at which the desired point ended the arc, NaN if never, shape (trials,) [s].
        obstacle: Middle of the obstacle, shape (trials, 2) [m].
        path: Path of each trial, leading shape (trials,).
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

    def figures(self) -> dict[str, Array]:
        """Return the figures of :func:`msrr_control.studies.metrics.figures`, each of shape (trials,)."""
        off, beside = metrics.deviation(self.tip, self.desired), metrics.from_path(self.tip, self.path)
        return metrics.figures(self.time, off, beside, self.arc_end, self.walled)

    def body_distance(self) -> Array:
        """Return the distance of the body from the middle of the obstacle, shape (steps, trials) [m]."""
        c, s = np.cos(self.pose[..., 2]), np.sin(self.pose[..., 2])
        dx, dy = self.obstacle[:, 0] - self.pose[..., 0], self.obstacle[:, 1] - self.pose[..., 1]
        along = np.maximum(np.abs(c * dx + s * dy) - HALF_BODY_M, 0.0)
        across = np.maximum(np.abs(c * dy - s * dx) - HALF_BODY_M, 0.0)
        distance: Array = np.hypot(along, across)
        return distance


def draw_paths(starts: PathFollowingStartSet, trials: int, rng: np.random.Generator) -> tuple[Path, Array]:
    """Draw paths that start in the origin along x, and an obstacle's middle near each, (trials, 2) [m]."""
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
    nearest = path.at(s)
    across = np.stack([-np.sin(nearest.heading), np.cos(nearest.heading)], axis=-1)
    return path, nearest.point + beside[:, None] * across


def run_path_following_study(
    law: PathFollowingLaw[State],
    limits: LimitsSpec,
    rng: np.random.Generator,
    trials: int = 200,
    starts: PathFollowingStartSet | None = None,
    disturbance: Disturbance | None = None,
    *,
    walls: WallSpec | None = None,
    pace: PaceSpec | None = None,
    offset: float = 0.10,
    rate_hz: float = 50.0,
    observer: Callable[[State], None] | None = None,
) -> PathFollowingStudyResult:
    """Simulate unicycles behind the nested limits of eq. 3 on circular paths past obstacles, all at once.

    Args:
        law: The law; its arrays have the leading shape (trials,).
        limits: What the drive can do.
        rng: Draws paths, obstacles and start errors, then grips, then the noise.
        trials: Number of trials.
        starts: Paths, obstacles and start errors.
        disturbance: Noise and delay of the pose, and slip; None is ideal.
        walls: When walls stand. Under a law that does not use walls they still define when the deviation is
            due to the obstacle.
        pace: Speed of the law's desired point, from which the duration of the trials follows.
        offset: l [m].
        rate_hz: Control rate.
        observer: Called with the state of the law at every step.

    Raises:
        ParameterError: There are no trials, or no rate.
        ProgramFailedError: The law returned commands of another shape, or some that are not finite.
    """
    require_in_range({"trials": TRIALS, "rate_hz": RATES_HZ}, locals())
    starts = starts if starts is not None else PathFollowingStartSet()
    disturbance = disturbance if disturbance is not None else Disturbance()
    walls = walls if walls is not None else WallSpec()
    pace = pace if pace is not None else PaceSpec()
    dt = 1.0 / rate_hz
    path, centre = draw_paths(starts, trials, rng)
    half_width = np.full(trials, walls.half_width(starts.obstacle_m or 0.0, HALF_BODY_M))
    encounter = find_encounter(path, centre, half_width, walls)
    obstacles = Obstacles(centre[:, None], np.full((trials, 1), starts.obstacle_m is not None))
    half = np.array([starts.error_m, starts.error_m, np.radians(starts.error_deg)])
    pose = rng.uniform(-half, half, size=(trials, 3))
    pose[:, 0] -= offset  # the controlled point begins at s = 0
    units = DisturbedUnicycles(pose, disturbance, limits, dt, rng)
    steps = int(np.ceil((float(path.length.max()) / pace.cruise_mps + 2.0 * pace.ramp_s + 3.0) / dt))
    poses = np.empty((steps, trials, 3))
    desired, commands, twists = (np.empty((steps, trials, 2)) for _ in range(3))
    walled = np.zeros((steps, trials), dtype=bool)
    arc_end = np.full(trials, np.nan)
    state: State | None = None
    for k in range(steps):
        _, late = units.measure()
        measured = read_only(late)
        state = law.start(measured, read_only(units.twist)) if state is None else state
        tip = offset_point(measured, offset)
        wall = side_wall(encounter, encounter.side, tip, centre, half_width, walls, offset)
        wall = wall._replace(active=wall.active & obstacles.present[:, 0])
        poses[k], twists[k], walled[k] = units.pose, units.twist, wall.active
        command, state = law.step(state, path, measured, wall, obstacles, dt)
        commands[k] = checked_commands(command, (trials, 2), law)
        desired[k] = state.desired
        if observer is not None:
            observer(state)
        arc_end = np.where(np.isnan(arc_end) & (state.pace.s >= path.arc_end), k * dt, arc_end)
        units.advance(commands[k])
    return PathFollowingStudyResult(
        time=dt * np.arange(steps, dtype=np.float64),
        pose=poses,
        tip=offset_point(poses, offset),
        desired=desired,
        command=commands,
        twist=twists,
        walled=walled,
        arc_end=arc_end,
        obstacle=centre,
        path=path,
    )
