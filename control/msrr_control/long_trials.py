"""Hundreds of unicycle trials of the long-distance phase under any law, in one call."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrr_control.long_law import LongLaw, State
from msrr_control.long_study import LongStartSet, LongStudyResult, draw_paths
from msrr_control.long_tracking import Obstacles
from msrr_control.offset_point import offset_point
from msrr_control.study import Disturbance
from msrr_control.unicycle import drive, moved_on, roll, slipped
from msrr_control.walls import WallSpec, encounter, side_wall
from msrr_scenes.vehicle import LimitsSpec

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LongTrials(LongStudyResult):
    """Truth of every step of every trial.

    Attributes:
        twist: Speeds behind the drive's limits, shape (steps, trials, 2).
    """

    twist: Array


def run_long_trials(
    law: LongLaw[State],
    limits: LimitsSpec,
    rng: np.random.Generator,
    trials: int = 200,
    starts: LongStartSet | None = None,
    disturbance: Disturbance | None = None,
    *,
    walls: WallSpec | None = None,
    cruise_mps: float = 0.22,
    ramp_s: float = 1.5,
    offset: float = 0.10,
    rate_hz: float = 50.0,
    observer: Callable[[State], None] | None = None,
) -> LongTrials:
    """Simulate unicycles behind the nested limits of eq. 3 on circular paths past obstacles, all at once.

    Other than :func:`msrr_control.long_study.run_long_study` it takes any law, and wheels may slip.

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
    starts = starts if starts is not None else LongStartSet()
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
    return LongTrials(
        time=dt * np.arange(steps, dtype=np.float64),
        pose=poses,
        tip=offset_point(poses, offset),
        desired=desired,
        command=commands,
        walled=walled,
        arc_end=arc_end,
        obstacle=centre,
        twist=twists,
    )
