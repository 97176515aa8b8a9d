"""Web page around the scene: title, readings, legend, and the timeline of a replay."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Sequence
from importlib.resources import files

from msrr_bullet.timeline.mission_series import Span, activity_spans
from msrr_bullet.timeline.palette import (
    ACTIVITY_COLOURS,
    ALARM,
    BELIEF,
    BLACK,
    CLEARANCE,
    DARK,
    DOCKING_UNIT,
    PATH,
    PHASE_COLOURS,
    PLAN,
    SIGHT,
    css,
    unit_colours,
)
from msrr_bullet.timeline.series import phase_spans
from msrr_bullet.timeline.snapshot import Snapshot, phase_name
from msrr_bullet.viewer.commands import Command, viewer_script
from msrr_bullet.viewer.readings import (
    HEADINGS,
    UNIT_READINGS,
    changes,
    labels,
    readings,
    unit_readings,
)
from msrr_scenes.messages import seconds
from msrr_scenes.specs.scene import Scene

_LEGEND = (
    ("docking unit, truth", DOCKING_UNIT),
    ("its belief: itself, its path, other bodies", BELIEF),
    ("driven path", PATH),
    ("camera and line of sight", SIGHT),
    ("smallest clearance", CLEARANCE),
)
#: Colours of the truth, which nobody knows of a recording.
_TRUTH = (DOCKING_UNIT, PATH, CLEARANCE)
#: Legend of a mission, whose units have colours of their own.
_LEGEND_MISSION = (
    ("way of a unit: narrow; granted route: wide", DARK),
    ("waits for", ALARM),
    ("docked pair", BLACK),
    ("where a unit under way believes to be", BELIEF),
    ("camera and line of sight", SIGHT),
    ("smallest clearance", CLEARANCE),
)
#: Entries of the legend for scenes with an overhead camera.
_LEGEND_OVERHEAD = (
    ("planned path and desired point", PLAN),
    ("clearance within reach of the collision monitor", ALARM),
)


def render_page(
    scene: Scene, commands: Iterable[Command] = (), snapshots: Sequence[Snapshot] | None = None
) -> str:
    """Return the page: a replay of snapshots, or without them a live page that connects to the server."""
    own = list(_LEGEND)
    if snapshots and all(snapshot.docking_pose is None for snapshot in snapshots):  # a recording
        own = [(name, colour) for name, colour in _LEGEND if colour not in _TRUTH]
    legend = (*own, *(_LEGEND_OVERHEAD if scene.cameras.overhead is not None else ()))
    legend = _LEGEND_MISSION if scene.coordinated else legend
    data = {
        "title": scene.name,
        "description": scene.description,
        "legend": [(name, css(colour)) for name, colour in legend],
        "readings": labels(scene),
        "headings": HEADINGS if scene.coordinated else (),
        "unitReadings": UNIT_READINGS if scene.coordinated else (),
        "colours": {unit: css(colour) for unit, colour in unit_colours(scene).items()},
        "commands": [base64.b64encode(command.data).decode("ascii") for command in commands],
        "replay": _timeline(scene, snapshots) if snapshots else None,
    }
    # "<" is escaped because "</script>" in the description of a scene would end the element that holds it.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    template = (files("msrr_bullet.viewer") / "page.html").read_text(encoding="utf-8")
    head, rest = template.split("{{meshcat}}")
    middle, tail = rest.split("{{data}}")
    return "".join((head, viewer_script(), middle, text, tail))


def _timeline(scene: Scene, snapshots: Sequence[Snapshot]) -> dict[str, object]:
    """Return times [s] and readings of a replay, and its rows over time: phases, or one for each unit."""
    times = [seconds(snapshot.stamp_ns - snapshots[0].stamp_ns) for snapshot in snapshots]
    rows: list[list[dict[str, object]]] = []
    if scene.coordinated:
        rows = [[_piece(span, unit) for span in activity_spans(snapshots, unit)] for unit in scene.units]
    else:
        spans = phase_spans(times, [snapshot.phase for snapshot in snapshots])
        rows.append(
            [
                {"name": phase_name(phase), "from": start, "to": end, "colour": css(PHASE_COLOURS[phase])}
                for phase, start, end in spans
            ]
        )
    by_unit = [unit_readings(snapshot) for snapshot in snapshots]
    return {
        "times": times,
        "values": changes(zip(*(readings(s, labels(scene)) for s in snapshots), strict=True)),
        "units": {unit: changes(zip(*(at[unit] for at in by_unit), strict=True)) for unit in by_unit[0]},
        "rows": rows,
    }


def _piece(span: Span, unit: str) -> dict[str, object]:
    """Return a piece of the row of a unit over time."""
    name = span.activity.value + (f" for {span.waits_for}" if span.waits_for else "")
    return {
        "name": f"{unit}: {name}",
        "from": span.start_s,
        "to": span.end_s,
        "colour": css(ACTIVITY_COLOURS[span.activity]),
        "waits": span.waits_for is not None,
    }
