"""The web page around the scene: title, readings, legend; and the timeline of a replay."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files

from msrr_bullet.timeline.palette import ALARM, BELIEF, CLEARANCE, DOCKING_UNIT, PATH, PLAN, SIGHT, css
from msrr_bullet.timeline.snapshot import Snapshot
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
)

_LEGEND = (
    ("docking unit, truth", DOCKING_UNIT),
    ("its belief: itself, its path, other bodies", BELIEF),
    ("driven path", PATH),
    ("camera and line of sight", SIGHT),
    ("smallest clearance", CLEARANCE),
)
#: What only a trial with a camera above the arena has.
_LEGEND_FROM_ABOVE = (("planned path and desired point", PLAN), ("clearance within the guard's reach", ALARM))


@dataclass(frozen=True, slots=True)
class PhaseSpan:
    """A stretch of the timeline [s]."""

    name: str
    start: float
    end: float
    colour: str


@dataclass(frozen=True, slots=True)
class Timeline:
    """What a replay shows beside the scene: readings at times [s], and the phases."""

    times: Sequence[float]
    values: Sequence[Sequence[str]]
    phases: Sequence[PhaseSpan]


def readings(snapshot: Snapshot) -> tuple[str, ...]:
    """Return the readings of an instant as text, in the order of :data:`READINGS`."""
    phase = snapshot.phase.value.replace("_", " ") if snapshot.phase else "–"
    path, los, error, clearance, pair = "–", "–", "–", "–", "–"
    if snapshot.assembly is not None:
        phase += f", {snapshot.assembly.stage}"
        if snapshot.path is not None:
            off = math.dist(snapshot.assembly.tip, snapshot.assembly.desired)
            path = f"{snapshot.assembly.s:.2f} of {snapshot.assembly.length:.2f} m, {1e3 * off:.0f} mm off"
    if snapshot.los is not None:
        left, right = math.degrees(snapshot.los.left), math.degrees(snapshot.los.right)
        los = snapshot.los.status.value
        if math.isfinite(left) and math.isfinite(right):
            los += f" {left:+.0f}° {right:+.0f}°"
    truth = snapshot.units.get(snapshot.step.unit) if snapshot.step else None
    if truth is not None and snapshot.estimate is not None:
        error_pose = truth.inverse() @ snapshot.estimate
        distance, yaw = math.hypot(error_pose.x, error_pose.y), math.degrees(error_pose.yaw)
        error = f"{1e3 * distance:.1f} mm {yaw:+.1f}°"
    if snapshot.clearance is not None:
        clearance = f"{1e3 * snapshot.clearance.distance:.0f} mm"
        pair = f"{snapshot.clearance.body_a} – {snapshot.clearance.body_b}"
    attempt = str(snapshot.attempt) if snapshot.attempt else "–"
    return f"{seconds(snapshot.stamp_ns):.2f} s", phase, attempt, path, los, error, clearance, pair


def render_page(scene: Scene, commands: Iterable[Command] = (), timeline: Timeline | None = None) -> str:
    """Return the page: a replay when it has a timeline, else one that waits for a feed."""
    replay = None
    if timeline is not None:
        spans = [{"name": s.name, "from": s.start, "to": s.end, "colour": s.colour} for s in timeline.phases]
        replay = {"times": timeline.times, "values": timeline.values, "phases": spans}
    above = scene.cameras.overhead is not None
    data = {
        "title": scene.name,
        "description": scene.description,
        "legend": [
            (name, css(colour)) for name, colour in (*_LEGEND, *(_LEGEND_FROM_ABOVE if above else ()))
        ],
        "readings": READINGS,
        "commands": [base64.b64encode(command.data).decode("ascii") for command in commands],
        "replay": replay,
    }
    # "<" is escaped because "</script>" in a scene's description would end the element that holds it.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    template = (files("msrr_bullet.viewer") / "page.html").read_text(encoding="utf-8")
    head, rest = template.split("{{meshcat}}")
    middle, tail = rest.split("{{data}}")
    return "".join((head, viewer_script(), middle, text, tail))
