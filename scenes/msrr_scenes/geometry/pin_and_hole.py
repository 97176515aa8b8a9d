"""What the pins of a port and the holes of another tolerate, measured on their collision shapes."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import hull_or_line
from msrr_scenes.geometry.unit_geometry import UnitGeometry

#: What a port without drawn holes is taken to tolerate: as much as that of the shipped unit [m].
_MOUTH_M, _PLAY_M = 0.015, 0.0015

#: A wall that begins this close behind a section is part of it [m].
_FLUSH_M = 1e-4

#: The ends of a section are looked at this far inside [m], where rounding cannot turn an edge across x into
#: one along x; and rounding of the share of an edge.
_WITHIN_M, _ROUNDING = 1e-7, 1e-9

#: Digits of what is measured [m]: no drawing is finer than a micrometre.
_DIGITS = 6

#: Of more points than this only the vertices of their hull are taken.
_MANY_POINTS = 200


@dataclass(frozen=True, slots=True)
class PinAndHole:
    """What the pins of an active port and the holes of a passive port tolerate, at the height of the pins.

    What they tolerate follows from widths alone, wherever pins and holes are.

    Attributes:
        pin_length: Length of the pins, from the plane of the face to the tips [m].
        mouth: Lateral error up to which the tips of a parallel unit pass the mouths of the holes [m].
        play: Lateral play of the pins to each side when the faces meet [m].
        pins: Places of the left and the right pin on the face, left of its middle positive [m].
    """

    pin_length: float
    mouth: float
    play: float
    pins: tuple[float, float]

    @classmethod
    def of(cls, unit: UnitGeometry, port: str, target: UnitGeometry, target_port: str) -> PinAndHole:
        """Measure the active port of a unit with pins, and the passive port of a target with holes.

        A port without drawn holes is taken to tolerate what the shipped one does. A mouth or a play that is
        not above 0 means pins that do not fit.

        Raises:
            GeometryError: The unit has no pins.
        """
        return _measure(unit, port, target, target_port)


def bounds(unit: UnitGeometry, link: str, X_FU: SE3) -> Array | None:
    """Return lowest and highest x, y, z of the shapes of a link in a frame F, shape (2, 3) [m].

    None if the link has no shapes.
    """
    points = [X_FU.act(solid.points()) for solid in unit.solids if solid.link == link]
    if not points:
        return None
    every = np.concatenate(points)
    return np.stack([every.min(axis=0), every.max(axis=0)])


@lru_cache(maxsize=64)
def _measure(unit: UnitGeometry, port: str, target: UnitGeometry, target_port: str) -> PinAndHole:
    tips = max(float(solid.points()[:, 0].max()) for solid in unit.pin_solids())
    length = tips - unit.control_offset(port)
    X_PU, X_DT = (SE3.from_se2(X.inverse()) for X in (unit.port(port), target.dock_frame(target_port)))
    ends = {f"port_{target_port}_hole_{side}" for side in ("left", "right")}
    walls = {solid.link for solid in target.solids} - ends - set(target.pins)
    found = [(math.inf, math.inf)]
    bodies = {pin: body for pin in unit.pins if (body := bounds(unit, pin, X_PU)) is not None}
    for (pin, body), end in product(bodies.items(), ends):
        plate = bounds(target, end, X_DT)
        if plate is None:
            continue
        depth, (_, middle, height) = min(length, float(plate[0, 0])), plate.mean(axis=0).tolist()
        parts = _sections(unit, {pin}, X_PU, float(body[:, 2].mean()), length)
        if not parts:
            continue  # prongs above and below
        found.append(_fit(parts, _sections(target, walls, X_DT, height, depth), middle, length))
    mouth, play = map(min, zip(*found, strict=True))
    if math.isinf(mouth):
        mouth, play = _MOUTH_M, _PLAY_M
    aside = [float(body[:, 1].mean()) for body in bodies.values()]
    pins = round(max(aside), _DIGITS), round(min(aside), _DIGITS)
    return PinAndHole(length, round(mouth, _DIGITS), round(play, _DIGITS), pins)


def _fit(pin: list[Array], walls: list[Array], middle: float, length: float) -> tuple[float, float]:
    """Return by how much a hole is wider than a pin, to each side: at its mouth for the tip, and all along.

    Both are infinite if the hole has no walls, or if the pin does not stand out of the face.
    All widths change linearly between the corners of the sections, so that the narrowest place is at the
    depth of a corner. Sections of the parts of the pin are in P, those of the walls in D, each of shape
    (N, 2), and the middle of the hole is along y of D [m].
    """
    corners = set(np.concatenate([*pin, *walls])[:, 0].tolist())
    depths = np.array([0.0, *sorted(x for x in corners if 0.0 < x < length), length])
    room = np.full(len(depths), math.inf)
    for wall in walls:
        low, high = _extent(wall, depths)
        room = np.fmin(room, np.where(low + high > 2.0 * middle, low - middle, middle - high))
    lows, highs = zip(*(_extent(part, depths) for part in pin), strict=True)
    half = 0.5 * (np.fmax.reduce(highs) - np.fmin.reduce(lows))
    reached = half[np.isfinite(half)]  # a pin may end before the longest one
    if not len(reached):
        return math.inf, math.inf
    mouth = next((float(r) for r in room if math.isfinite(r)), math.inf)
    return mouth - float(reached[-1]), float(np.fmin.reduce(room - half))


def _extent(section: Array, depths: Array) -> tuple[Array, Array]:
    """Return the lowest and the highest y of a convex section at each depth [m], NaN where it does not reach.

    Corners of the section are counter-clockwise, shape (N, 2), two if it is a line; depths, shape (K,), are
    along x.
    """
    first, last = section[:, 0].min(), section[:, 0].max()
    inside = (depths >= first - _FLUSH_M) & (depths <= last + _FLUSH_M)
    within = min(_WITHIN_M, 0.5 * (last - first))
    at = np.clip(depths, first + within, last - within)
    p, q = section, np.roll(section, -1, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (at[:, None] - p[:, 0]) / (q[:, 0] - p[:, 0])
    share[np.isnan(share)] = 0.0  # a line across x is all at the depth
    y = np.where(np.abs(share - 0.5) <= 0.5 + _ROUNDING, p[:, 1] + share * (q[:, 1] - p[:, 1]), math.nan)
    y[~inside] = math.nan
    return np.fmin.reduce(y, axis=1), np.fmax.reduce(y, axis=1)


def _sections(
    unit: UnitGeometry, links: Collection[str], X_FU: SE3, height: float, depth: float
) -> list[Array]:
    """Return the sections at a height of those shapes of some links that lie within a depth behind a face.

    F is the frame of the port, with x along the depth; height is above the ground [m].

    Returns:
        For each shape the corners of its section in F, counter-clockwise, shape (N, 2) [m]; two of one that
        is flat or touches the height.
    """
    found = []
    for solid in unit.solids:
        points = X_FU.act(solid.points()) if solid.link in links else np.empty((0, 3))
        low, high = points.min(axis=0, initial=math.inf), points.max(axis=0, initial=-math.inf)
        if low[0] <= depth and high[0] >= 0.0 and low[2] < height < high[2]:
            found.append(hull_or_line(_section(points, height)))
    return found


def _section(points: Array, height: float) -> Array:
    """Return points whose convex hull is the section of that of ``points``, shape (N, 3), at a height [m].

    There is a section at that height.
    """
    if len(points) > _MANY_POINTS:
        # Its import takes longer than all that is computed here.
        from scipy.spatial import ConvexHull

        # Flat shapes have no hull; with what is added about the middle, which is inside others, they do.
        about = points.mean(axis=0) + _WITHIN_M * np.concatenate([np.eye(3), -np.eye(3)])
        kept = ConvexHull(np.concatenate([points, about])).vertices
        points = points[kept[kept < len(points)]]
    below, above = points[points[:, 2] < height], points[points[:, 2] >= height]
    p, q = below[:, None], above[None]
    share = (height - p[..., 2]) / (q[..., 2] - p[..., 2])
    return (p + share[..., None] * (q - p)).reshape(-1, 3)[:, :2]
