"""Figures of the long-distance phase, from time series alone: of a study, of a log, of a real unit.

Each function takes series whose first axis is time; further axes are trials. A figure that a series does not
have (no obstacle was met, no arc was ended) is NaN.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Deviation [m] below which an obstacle counts as recovered from.
RECOVERED_M = 0.05

#: Time by which an obstacle episode outlasts that [s]; the position gain of the path is about 1 1/s.
TAIL_S = 2.0

#: Time before and after the end of the arc over which steady tracking is judged [s].
BEFORE_S, AFTER_S = 1.0, 2.0


def deviation(tip: Array, desired: Array) -> Array:
    """Return the distance of the controlled point from the desired one, (T, ..., 2) to (T, ...) [m]."""
    distance: Array = np.hypot(tip[..., 0] - desired[..., 0], tip[..., 1] - desired[..., 1])
    return distance


def obstacle_episode(time: Array, off: Array, walled: Mask) -> Mask:
    """Return when the deviation is an obstacle's doing.

    From the first instant at which a wall stands until ``TAIL_S`` after the deviation falls below
    ``RECOVERED_M`` behind the last one: what is left of it then decays with the slowest gain, and is no error
    of steady tracking.

    Args:
        time: Shape (T,) [s].
        off: Deviation, shape (T, ...) [m].
        walled: When a wall stood, shape (T, ...).

    Returns:
        Shape (T, ...).
    """
    began = np.logical_or.accumulate(walled, axis=0)
    more_to_come = np.logical_or.accumulate(walled[::-1], axis=0)[::-1]
    after = began & ~more_to_come
    settled = np.logical_or.accumulate(after & (off <= RECOVERED_M), axis=0)
    since = time[np.argmax(settled, axis=0)]
    t = time.reshape(-1, *(1,) * (off.ndim - 1))
    episode: Mask = began & ~(settled & (t > since + TAIL_S))
    return episode


def tracking_error(time: Array, off: Array, arc_end: Array, episode: Mask) -> Array:
    """Return the largest deviation [m] about the end of the arc, outside of obstacle episodes.

    Args:
        time: Shape (T,) [s].
        off: Deviation, shape (T, ...) [m].
        arc_end: When the desired point ended the arc, NaN if never, shape (...) [s].
        episode: As :func:`obstacle_episode` gives it, shape (T, ...).
    """
    t = time.reshape(-1, *(1,) * (off.ndim - 1))
    judged = (t >= arc_end - BEFORE_S) & (t <= arc_end + AFTER_S) & ~episode
    return _largest(off, judged)


def amplitude(off: Array, episode: Mask) -> Array:
    """Return the largest deviation during the obstacle episode, shape (...) [m]."""
    return _largest(off, episode)


def recovery_time(time: Array, off: Array, episode: Mask) -> Array:
    """Return the time [s] from the largest deviation of the episode to the last one above 0.05 m in it.

    Shape (...); 0 where the deviation never exceeds 0.05 m.
    """
    peak = np.argmax(np.where(episode, off, -1.0), axis=0)
    beyond = episode & (off > RECOVERED_M)
    last = len(time) - 1 - np.argmax(beyond[::-1], axis=0)
    took = np.where(beyond.any(axis=0), time[last] - time[peak], 0.0)
    recovered: Array = np.where(episode.any(axis=0), took, np.nan)
    return recovered


def _largest(off: Array, where: Mask) -> Array:
    largest: Array = np.max(np.where(where, off, -np.inf), axis=0)
    return np.where(np.isfinite(largest), largest, np.nan)
