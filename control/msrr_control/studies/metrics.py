"""Figures of the long-distance phase, computed from the time series of a study, a log or a real unit.

Each function takes series whose first axis is time; further axes are trials: ``time`` has shape (T,) [s], a
distance ``off`` (T, ...) [m], and an ``episode``, the result of :func:`obstacle_episode`, (T, ...). A figure
that a series does not have (no obstacle was encountered, no arc ended) is NaN.

Two distances are distinguished. The *deviation* is the distance of the controlled point from the desired
POINT, which moves along the path with time: it is large for a unit that is held up, even on the path. The
*distance from the path* is the distance from the curve. Tracking error, amplitude and recovery use the
deviation; the distance from the path shows how much of an amplitude is a swing off the path and not time
lost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrr_control.path_following.path import Path
from msrr_scenes.arrays import Array

Mask = NDArray[np.bool_]

#: Deviation [m] below which an obstacle counts as recovered from.
RECOVERED_M = 0.05

#: Time by which an obstacle episode outlasts its recovery [s]; the position gain of the path is about 1 1/s.
TAIL_S = 2.0

#: Time before and after the end of the arc over which steady tracking is judged [s].
BEFORE_S, AFTER_S = 1.0, 2.0


def deviation(tip: Array, desired: Array) -> Array:
    """Return the distance of the controlled point from the desired point, (T, ..., 2) to (T, ...) [m].

    It includes the lag along the path; :func:`from_path` is the distance from the curve.
    """
    distance: Array = np.hypot(tip[..., 0] - desired[..., 0], tip[..., 1] - desired[..., 1])
    return distance


def from_path(tip: Array, path: Path) -> Array:
    """Return the distance of the controlled point from the nearest point of its whole path.

    Args:
        tip: Shape (T, ..., 2) [m].
        path: One for each trial, leading shape (...); its arcs are no more than full circles.

    Returns:
        Shape (T, ...) [m].
    """
    ends = np.cumsum(path.lengths, axis=-1)
    nearest = deviation(tip, path.at(np.zeros(ends.shape[:-1])).point)
    for k in range(ends.shape[-1]):
        length, curvature = path.lengths[..., k], path.curvature[..., k]
        begin = path.at(ends[..., k] - length)
        c, s = np.cos(begin.heading), np.sin(begin.heading)
        dx, dy = tip[..., 0] - begin.point[..., 0], tip[..., 1] - begin.point[..., 1]
        ahead, left = c * dx + s * dy, c * dy - s * dx
        # In the frame of the start of the piece, the line is y = 0 and the circle's middle (0, 1 /
        # curvature).
        bent = curvature != 0.0
        radius = 1.0 / np.where(bent, curvature, 1.0)
        side = np.sign(radius)
        swept = np.mod(np.arctan2(ahead, side * (radius - left)), 2.0 * np.pi)
        reached = np.where(bent, swept * np.abs(radius), ahead)
        beside = np.where(bent, np.abs(np.hypot(ahead, left - radius) - np.abs(radius)), np.abs(left))
        alongside = (reached >= 0.0) & (reached <= length)
        nearest = np.minimum(nearest, np.where(alongside, beside, np.inf))
        nearest = np.minimum(nearest, deviation(tip, path.at(ends[..., k]).point))
    return nearest


def from_line(tip: Array, line: Array) -> Array:
    """Return the distance of points, shape (T, 2), from a line through points, shape (N, 2) [m].

    It replaces :func:`from_path` where a log has points of a path instead of the path itself.
    """
    if len(line) == 1:
        return deviation(tip, line[0])
    begin, segment = line[:-1], np.diff(line, axis=0)
    moved = np.any(segment != 0.0, axis=-1)  # a line has many equal points where something waited
    if moved.any():
        begin, segment = begin[moved], segment[moved]
    squared = np.sum(segment**2, axis=-1)
    squared[squared == 0.0] = 1.0
    distance = np.empty(len(tip))
    for i, point in enumerate(tip):  # one by one, for points times segments would be many megabytes
        share = np.sum((point - begin) * segment, axis=-1) / squared
        foot = begin + np.clip(share, 0.0, 1.0)[:, None] * segment
        distance[i] = deviation(point, foot).min()
    return distance


def obstacle_episode(time: Array, off: Array, walled: Mask) -> Mask:
    """Return when the deviation ``off`` is due to an obstacle, shape (T, ...).

    An episode begins with the first wall and ends ``TAIL_S`` after the deviation from the desired point falls
    below ``RECOVERED_M`` behind the last wall: what remains then decays with the slowest gain, and is no
    error of steady tracking. ``walled`` is whether a wall stood, shape (T, ...).

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
    """Return the largest deviation from the desired point [m] about the end of the arc, episodes left out.

    The desired point ended the arc at time ``arc_end``, NaN if never, shape (...) [s].
    """
    t = time.reshape(-1, *(1,) * (off.ndim - 1))
    judged = (t >= arc_end - BEFORE_S) & (t <= arc_end + AFTER_S) & ~episode
    return _largest(off, judged)


def amplitude(off: Array, episode: Mask) -> Array:
    """Return the largest distance during the obstacle episode, shape (...) [m].

    For the deviation from the desired point (:func:`deviation`) it includes the lag along the path; for the
    distance from the curve (:func:`from_path`) it is the swing off the path alone.
    """
    return _largest(off, episode)


def recovery_time(time: Array, off: Array, episode: Mask) -> Array:
    """Return the time [s] from the largest distance of the episode to the last above 0.05 m, shape (...).

    For the deviation from the desired point it includes the time in which a unit that is back on the path
    catches up. It is 0 where the distance never exceeds 0.05 m, and infinite where it does to the end of the
    series: a unit that ended at its obstacle has not recovered.
    """
    peak = np.argmax(np.where(episode, off, -1.0), axis=0)
    beyond = episode & (off > RECOVERED_M)
    last = len(time) - 1 - np.argmax(beyond[::-1], axis=0)
    took = np.where(beyond.any(axis=0), time[last] - time[peak], 0.0)
    end = len(time) - 1 - np.argmax(episode[::-1], axis=0)
    ends_beyond = np.take_along_axis(beyond, np.expand_dims(end, 0), axis=0)[0]
    took = np.where(ends_beyond, np.inf, took)
    recovered: Array = np.where(episode.any(axis=0), took, np.nan)
    return recovered


def figures(time: Array, off: Array, beside: Array, arc_end: Array, walled: Mask) -> dict[str, Array]:
    """Return all of these figures by name, amplitude and recovery also by the distance from the path.

    The arguments are those of :func:`tracking_error` and :func:`obstacle_episode`; ``beside`` is the distance
    from the path, shape (T, ...) [m].
    """
    episode = obstacle_episode(time, off, walled)
    return {
        "tracking": tracking_error(time, off, arc_end, episode),
        "amplitude": amplitude(off, episode),
        "amplitude_path": amplitude(beside, episode),
        "recovery": recovery_time(time, off, episode),
        "recovery_path": recovery_time(time, beside, episode),
    }


def _largest(off: Array, where: Mask) -> Array:
    largest: Array = np.max(np.where(where, off, -np.inf), axis=0)
    return np.where(np.isfinite(largest), largest, np.nan)
