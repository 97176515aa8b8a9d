"""What all drawings of a mission show in the same way: names of units, driven ways and docked pairs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from msrr_bullet.timeline.mission_snapshot import Activity, MissionSnapshot
from msrr_bullet.timeline.palette import ALARM, BLACK
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.arrays import Array
from msrr_scenes.specs.scene import Scene

#: Smallest distance between two points of a drawn way [m].
STEP_M = 0.004
#: Half the length of the bar that marks a docked pair [m].
JOINT_M = 0.05
#: Largest number of letters of a name in a drawing.
_LONGEST = 12


def short_name(unit: str) -> str:
    """Return the name of a unit as drawings show it, without the middle of a long one."""
    return unit if len(unit) <= _LONGEST else f"{unit[: _LONGEST // 2]}..{unit[2 - _LONGEST // 2 :]}"


def name_of(unit: str, mission: MissionSnapshot | None) -> tuple[str, int]:
    """Return the name of a unit as drawings show it, and its colour; that of one that failed says so."""
    shown = short_name(unit)
    if mission is not None and mission.activity(unit) is Activity.FAILED:
        return f"{shown} failed", ALARM
    return shown, BLACK


def driven_way(snapshots: Sequence[Snapshot], unit: str) -> Array:
    """Return the points in W that a unit passed, at least :data:`STEP_M` apart, shape (N, 2) [m]."""
    points = [(X.x, X.y) for X in (snapshot.units[unit] for snapshot in snapshots)]
    way = points[:1]
    for point in points:
        if math.dist(point, way[-1]) >= STEP_M:
            way.append(point)
    return np.array(way)


def docked_pairs(scene: Scene, snapshot: Snapshot) -> dict[str, Array]:
    """Return the ends of a bar across each port that holds a unit, by that unit, shape (2, 2) in W [m]."""
    bars = {}
    for unit in scene.units:
        port = None if snapshot.mission is None else snapshot.mission.docked_to(unit)
        if port is not None:
            holder, _, name = port.partition(".")
            X_WD = snapshot.units[holder] @ scene.geometry(holder).dock_frame(name)
            bars[unit] = X_WD.act([[0.0, -JOINT_M], [0.0, JOINT_M]])
    return bars
