"""Where tracks and bodies come nearer to each other than the gaps that moving units keep."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from msrr_control.shapes.bodies import BESIDE_GAP_M, LOSS_M, Body
from msrr_control.tracks.route_request import RouteRequest, Standing
from msrr_control.tracks.track import Track, standing
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2

#: Gap that moving bodies keep from others [m]: on the way, what the collision monitors keep (30 mm), what
#: they may be nearer than they seem (11 mm), and as far as two of them overshoot where they stop (12 mm
#: each); in a leg into or out of a port, where a unit swings about its path by some centimetres; and between
#: two at ports, where both are to be near. On the way and in such a leg it grows where distances are known
#: less well.
GAP_M = 0.065
LANE_GAP_M = 0.09
PORT_GAP_M = 0.02


def needed(earlier: Track, later: Track, body: Body) -> Array:
    """Return how far the earlier unit has to be for the later one to pass each sample of its own track.

    The earlier unit goes first, and the later one keeps out of what the other still has to drive.

    Returns:
        Arc lengths on the earlier track, not descending, shape (N,) [m]; infinite where the earlier one never
        gets out of the way.
    """
    in_lane = (earlier.at_port & bool(earlier.legs))[:, None] | (later.at_port & bool(later.legs))[None]
    both_at_port = earlier.at_port[:, None] & later.at_port[None]
    gap = np.where(both_at_port, PORT_GAP_M, np.where(in_lane, LANE_GAP_M, GAP_M) + body.extra_gap)
    near = body.near(earlier.poses[:, None], later.poses[None], gap)
    passed = np.append(earlier.s[1:], math.inf)
    last = len(earlier.s) - 1 - near[::-1].argmax(axis=0)
    until = np.where(near.any(axis=0), passed[last], -math.inf)
    result: Array = np.maximum.accumulate(until)
    return result


def first_near(track: Track, X_WB: SE2, at_port: bool, body: Body) -> float | None:
    """Return where a track first comes too near to a standing body [m]; None if it never does.

    ``at_port`` is whether that body stands at a port.
    """
    until = needed(standing(X_WB, at_port), track, body)
    return float(track.s[np.searchsorted(until, math.inf)]) if until[-1] == math.inf else None


def _first_loss(track: Track, other: Standing, body: Body) -> float | None:
    """Return where a track in the open comes nearer to a body that is near [m]; None if it never does."""
    gaps = body.gaps(track.poses, other.X_WB.as_array())
    kept = np.minimum(np.maximum.accumulate(gaps), BESIDE_GAP_M + body.extra_gap) - LOSS_M
    lost = (gaps < kept) & ~track.at_port
    return float(track.s[lost.argmax()]) if lost.any() else None


def contact_on_the_way(track: Track, request: RouteRequest, body: Body) -> tuple[float, str] | None:
    """Return where a track comes too near to what stands there, as :func:`first_contact` does.

    The units of the ports that are left and entered count as well, but not in the legs out of and into a
    port.
    """
    partners = [s for s in request.standing if s.name in (request.leaves, request.enters)]
    between = ~track.at_port
    open_part = Track(track.legs, track.s[between], track.poses[between], track.at_port[between])
    return first_contact(track, request.others, body) or (
        first_contact(open_part, partners, body) if between.any() else None
    )


def first_contact(track: Track, others: Sequence[Standing], body: Body) -> tuple[float, str] | None:
    """Return where a track first comes too near to a standing body [m], and to which; None if never.

    To a body that stands beside the start it may come nearer than moving units do: into and out of a port as
    near as neighbours are, else as near as it has been, because the collision monitor lets a unit that is
    near only drive away.
    """
    start = SE2(*track.poses[0].tolist())
    contacts: list[tuple[float, str]] = []
    for other in others:
        beside = is_beside(start, other, body)
        compared = _at_port(track) if beside else track
        met = first_near(compared, other.X_WB, other.at_port or beside, body)
        lost = _first_loss(track, other, body) if beside else None
        contacts += [(s, other.name) for s in (met, lost) if s is not None]
    return min(contacts, key=lambda contact: contact[0], default=None)


def is_beside(X_WU: SE2, other: Standing, body: Body) -> bool:
    """Return whether a body stands so near that a unit may come too near to it by a turn on the spot."""
    apart = math.hypot(other.X_WB.x - X_WU.x, other.X_WB.y - X_WU.y)
    return apart < 2.0 * body.radius + GAP_M + body.extra_gap


def _at_port(track: Track) -> Track:
    return Track(track.legs, track.s, track.poses, np.ones(len(track.s), dtype=np.bool_))
