"""Readings of a snapshot as text: of the trial, of one unit, and of all units of a mission."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from msrr_bullet.timeline.mission_table import mission_text, unit_rows
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.messages import seconds
from msrr_scenes.specs.scene import Scene

#: Labels of the readings of units on their own.
READINGS = (
    "time",
    "phase",
    "attempt",
    "on the path",
    "line of sight",
    "belief off by",
    "clearance",
    "nearest pair",
    "collision monitor",
)
#: Labels of the readings of a mission, of one of its units, and of the table of all.
MISSION_READINGS = ("time", "mission", "clearance", "nearest pair")
UNIT_READINGS = (
    "phase",
    "attempt",
    "on the path",
    "line of sight",
    "belief off by",
    "collision monitor",
    "reason",
)
HEADINGS = ("unit", "does", "to", "driven / granted / route", "waits for")

#: Text of a reading that there is not.
NONE = "–"


def labels(scene: Scene) -> tuple[str, ...]:
    """Return the labels of the readings that do not belong to one unit of a mission."""
    return MISSION_READINGS if scene.coordinated else READINGS


def readings(snapshot: Snapshot, names: Iterable[str] = READINGS) -> tuple[str, ...]:
    """Return readings of a snapshot as text; those of a unit are of the first one under way."""
    texts = _texts(snapshot)
    return tuple(texts.get(name) or NONE for name in names)


def unit_readings(snapshot: Snapshot) -> dict[str, tuple[str, ...]]:
    """Return for every unit of a mission its row of the table, then its readings; empty without a mission."""
    return {
        row.unit: (
            *(row.unit, row.does, row.task or NONE, row.route or NONE, row.waits_for or NONE),
            *readings(snapshot.of_unit(row.unit), UNIT_READINGS[:-1]),
            row.reason or NONE,
        )
        for row in unit_rows(snapshot)
    }


def changes(columns: Iterable[Sequence[str]]) -> list[list[list[int] | list[str]]]:
    """Return for every column of texts the indices at which it changes, and the texts from there on."""
    result: list[list[list[int] | list[str]]] = []
    for column in columns:
        at = [i for i, text in enumerate(column) if i == 0 or text != column[i - 1]]
        result.append([at, [column[i] for i in at]])
    return result


def _texts(snapshot: Snapshot) -> dict[str, str]:
    first, texts = snapshot.first, {"time": f"{seconds(snapshot.stamp_ns):.2f} s"}
    if first.los is not None:
        left, right = math.degrees(first.los.left), math.degrees(first.los.right)
        texts["line of sight"] = first.los.status.value
        if math.isfinite(left) and math.isfinite(right):
            texts["line of sight"] += f" {left:+z.0f}° {right:+z.0f}°"
    if snapshot.docking_pose is not None and first.estimate is not None:
        error_pose = snapshot.docking_pose.inverse() @ first.estimate
        distance, yaw = math.hypot(error_pose.x, error_pose.y), math.degrees(error_pose.yaw)
        texts["belief off by"] = f"{1e3 * distance:.1f} mm {yaw:+z.1f}°"
    if snapshot.clearance is not None:
        texts["clearance"] = f"{1e3 * snapshot.clearance.distance:z.0f} mm"
        texts["nearest pair"] = f"{snapshot.clearance.body_a} – {snapshot.clearance.body_b}"
    if first.monitor is not None:
        texts["collision monitor"] = f"{first.monitor.state.value}, {first.monitor}"
    if first.attempt:
        texts["attempt"] = str(first.attempt)
    if snapshot.mission is not None:
        texts["mission"] = mission_text(snapshot.mission)
    return texts | {"phase": first.phase_text, "on the path": first.path_text}
