"""What the page of a finished run holds beside its 3-D view, all on one axis of time."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

from msrr_bullet.log.records import Event, Level
from msrr_bullet.timeline.mission_series import EventKind, Span, activity_spans, unit_events
from msrr_bullet.timeline.palette import ACTIVITY_COLOURS, PHASE_COLOURS, css
from msrr_bullet.timeline.series import phase_spans
from msrr_bullet.timeline.snapshot import Snapshot, phase_name
from msrr_bullet.timeline.still import Still
from msrr_bullet.viewer.plots import plots_of_run
from msrr_bullet.viewer.readings import changes, labels, readings, unit_readings
from msrr_scenes.messages import OVERHEAD, carrier_of, seconds
from msrr_scenes.specs.scene import Scene

#: Events of a mission that are marked like errors.
_FAILURES = (EventKind.ATTEMPT_FAILED, EventKind.FAILED)


def replay_data(
    scene: Scene, snapshots: Sequence[Snapshot], stills: Iterable[Still], events: Iterable[Event]
) -> dict[str, Any]:
    """Return what a page shows of a run, as JSON holds it; times are those of the log [s].

    Snapshots, at least one, and events are in order of time, as are the stills of each camera.
    """
    times = [seconds(snapshot.stamp_ns) for snapshot in snapshots]
    by_unit = [unit_readings(snapshot) for snapshot in snapshots]
    happened = _events(scene, snapshots, events)
    cameras = _cameras(stills)
    return {
        "times": times,
        "end": max([times[-1], *(event["time"] for event in happened)]),
        "values": changes(zip(*(readings(s, labels(scene)) for s in snapshots), strict=True)),
        "units": {unit: changes(zip(*(at[unit] for at in by_unit), strict=True)) for unit in by_unit[0]},
        "watched": changes([["" if s.watched is None else s.watched.unit for s in snapshots]])[0],
        "rows": _rows(scene, snapshots, times),
        "events": happened,
        "stills": cameras,
        "stillInterval": max((_interval(camera["times"]) for camera in cameras), default=0.0),
        "plots": plots_of_run(scene, snapshots),
    }


def _rows(scene: Scene, snapshots: Sequence[Snapshot], times: Sequence[float]) -> list[list[dict[str, Any]]]:
    """Return the rows over time: one of the phases, or one of what it does for each unit of a mission."""
    if scene.coordinated:
        return [[_piece(span, unit) for span in activity_spans(snapshots, unit)] for unit in scene.units]
    spans = phase_spans(times, [snapshot.first.phase for snapshot in snapshots])
    return [
        [
            {"name": phase_name(phase), "from": start, "to": end, "colour": css(PHASE_COLOURS[phase])}
            for phase, start, end in spans
        ]
    ]


def _piece(span: Span, unit: str) -> dict[str, Any]:
    """Return a piece of the row of a unit over time."""
    name = span.activity.value + (f" for {span.waits_for}" if span.waits_for else "")
    return {
        "name": f"{unit}: {name}",
        "from": span.start_s,
        "to": span.end_s,
        "colour": css(ACTIVITY_COLOURS[span.activity]),
        "waits": span.waits_for is not None,
    }


def _events(scene: Scene, snapshots: Sequence[Snapshot], logged: Iterable[Event]) -> list[dict[str, Any]]:
    """Return the events of the log, and what happened to the units of a mission, in order of time."""
    events = []
    for event in logged:
        time_s = seconds(event.stamp_ns)
        alarm = event.level.value >= Level.WARNING.value
        events.append(_event(time_s, event.source, event.text, alarm))
    for unit in scene.units if scene.coordinated else ():
        for own in unit_events(snapshots, unit):
            text = f"{own.kind.value}, {own.text}" if own.text else own.kind.value
            events.append(_event(own.time_s, unit, text, own.kind in _FAILURES))
    return sorted(events, key=lambda event: float(event["time"]))


def _event(time: float, source: str, text: str, alarm: bool) -> dict[str, Any]:
    return {"time": max(0.0, round(time, 3)), "source": source, "text": text, "alarm": alarm}


def _cameras(stills: Iterable[Still]) -> list[dict[str, Any]]:
    """Return the stills of every camera, the overhead camera first."""
    by_camera: dict[str, list[Still]] = {}
    for still in stills:
        by_camera.setdefault(still.camera, []).append(still)
    ordered = sorted(by_camera.items(), key=lambda item: item[0] != OVERHEAD)
    return [camera_data(camera, own) for camera, own in ordered]


def camera_data(camera: str, stills: Sequence[Still] = ()) -> dict[str, Any]:
    """Return what a page shows of a camera, as JSON holds it."""
    legend = stills[0].legend if stills else ()
    return {
        "name": camera,
        "unit": carrier_of(camera),
        "kind": stills[0].kind if stills else "",
        "times": [seconds(still.stamp_ns) for still in stills],
        "images": [base64.b64encode(still.data).decode("ascii") for still in stills],
        "texts": [still.text for still in stills],
        "legend": [(text, css(colour), dashed) for text, colour, dashed in legend],
    }


def _interval(times: Sequence[float]) -> float:
    """Return the median time between two stills of a camera [s]."""
    gaps = sorted(b - a for a, b in pairwise(times))
    return gaps[len(gaps) // 2] if gaps else 0.0
