"""Web page around the scene: title, readings, legend, and the timeline of a replay."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterable, Sequence
from importlib.resources import files

from msrr_bullet.timeline.palette import (
    ALARM,
    BELIEF,
    CLEARANCE,
    DOCKING_UNIT,
    PATH,
    PHASE_COLOURS,
    PLAN,
    SIGHT,
    css,
)
from msrr_bullet.timeline.series import phase_spans
from msrr_bullet.timeline.snapshot import Snapshot, phase_name
from msrr_bullet.viewer.commands import Command, viewer_script
from msrr_scenes.messages import seconds
from msrr_scenes.specs.scene import Scene

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

_LEGEND = (
    ("docking unit, truth", DOCKING_UNIT),
    ("its belief: itself, its path, other bodies", BELIEF),
    ("driven path", PATH),
    ("camera and line of sight", SIGHT),
    ("smallest clearance", CLEARANCE),
)
#: Entries of the legend for scenes with an overhead camera.
_LEGEND_OVERHEAD = (
    ("planned path and desired point", PLAN),
    ("clearance within reach of the collision monitor", ALARM),
)


def readings(snapshot: Snapshot) -> tuple[str, ...]:
    """Return the readings of a snapshot as text, in the order of :data:`READINGS`."""
    los, error, clearance, pair, monitor = "–", "–", "–", "–", "–"
    if snapshot.los is not None:
        left, right = math.degrees(snapshot.los.left), math.degrees(snapshot.los.right)
        los = snapshot.los.status.value
        if math.isfinite(left) and math.isfinite(right):
            los += f" {left:+.0f}° {right:+.0f}°"
    if snapshot.docking_pose is not None and snapshot.estimate is not None:
        error_pose = snapshot.docking_pose.inverse() @ snapshot.estimate
        distance, yaw = math.hypot(error_pose.x, error_pose.y), math.degrees(error_pose.yaw)
        error = f"{1e3 * distance:.1f} mm {yaw:+.1f}°"
    if snapshot.clearance is not None:
        clearance = f"{1e3 * snapshot.clearance.distance:.0f} mm"
        pair = f"{snapshot.clearance.body_a} – {snapshot.clearance.body_b}"
    if snapshot.monitor is not None:
        monitor = f"{snapshot.monitor.state.value}, {snapshot.monitor}"
    attempt = str(snapshot.attempt) if snapshot.attempt else "–"
    phase, path = snapshot.phase_text or "–", snapshot.path_text or "–"
    return f"{seconds(snapshot.stamp_ns):.2f} s", phase, attempt, path, los, error, clearance, pair, monitor


def render_page(
    scene: Scene, commands: Iterable[Command] = (), snapshots: Sequence[Snapshot] | None = None
) -> str:
    """Return the page: a replay of snapshots, or without them a live page that connects to the server."""
    legend = _LEGEND + (_LEGEND_OVERHEAD if scene.cameras.overhead is not None else ())
    data = {
        "title": scene.name,
        "description": scene.description,
        "legend": [(name, css(colour)) for name, colour in legend],
        "readings": READINGS,
        "commands": [base64.b64encode(command.data).decode("ascii") for command in commands],
        "replay": _timeline(snapshots) if snapshots else None,
    }
    # "<" is escaped because "</script>" in the description of a scene would end the element that holds it.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    template = (files("msrr_bullet.viewer") / "page.html").read_text(encoding="utf-8")
    head, rest = template.split("{{meshcat}}")
    middle, tail = rest.split("{{data}}")
    return "".join((head, viewer_script(), middle, text, tail))


def _timeline(snapshots: Sequence[Snapshot]) -> dict[str, object]:
    """Return times [s], readings and phases of a replay."""
    times = [seconds(snapshot.stamp_ns - snapshots[0].stamp_ns) for snapshot in snapshots]
    phases = [
        {"name": phase_name(phase), "from": start, "to": end, "colour": css(PHASE_COLOURS[phase])}
        for phase, start, end in phase_spans(times, [snapshot.phase for snapshot in snapshots])
    ]
    return {"times": times, "values": [readings(snapshot) for snapshot in snapshots], "phases": phases}
