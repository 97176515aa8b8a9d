"""Web page of a run: the files of ``web`` put together with the data that they show.

A finished run has its 3-D view, camera images, plots and events on one axis of time. The live page shows the
3-D view, the camera images and the readings of the present.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterable, Sequence
from importlib.resources import files
from typing import Any

from msrr_bullet.log.records import Event
from msrr_bullet.timeline.palette import (
    ALARM,
    BACKGROUNDS,
    BELIEF,
    BLACK,
    CLEARANCE,
    DARK,
    DOCKING_UNIT,
    IN_THE_DARK,
    PATH,
    PLAN,
    SIGHT,
    css,
    unit_colours,
)
from msrr_bullet.timeline.snapshot import Snapshot, moving_units
from msrr_bullet.timeline.still import Still
from msrr_bullet.viewer.commands import Command, viewer_script
from msrr_bullet.viewer.readings import HEADINGS, UNIT_READINGS, labels
from msrr_bullet.viewer.replay_data import camera_data, replay_data
from msrr_scenes.messages import OVERHEAD, onboard_camera
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
    ("where a unit under way believes it is", BELIEF),
    ("camera and line of sight", SIGHT),
    ("smallest clearance", CLEARANCE),
)
#: Entries of the legend for scenes with an overhead camera.
_LEGEND_OVERHEAD = (
    ("planned path and desired point", PLAN),
    ("clearance within reach of the collision monitor", ALARM),
)

#: Places in ``page.html`` and the files that fill them, and the scripts of this project in their order.
_FILES = {
    "style": "page.css",
    "plot_style": "vendor/uPlot.min.css",
    "plot_script": "vendor/uPlot.min.js",
    "plot_licence": "vendor/uPlot.LICENSE",
}
_SCRIPTS = ("view.js", "readings.js", "player.js", "cameras.js", "plots.js", "events.js", "start.js")


def render_page(
    scene: Scene,
    commands: Iterable[Command] = (),
    snapshots: Sequence[Snapshot] | None = None,
    stills: Iterable[Still] = (),
    events: Iterable[Event] = (),
    *,
    live_cameras: bool = False,
) -> str:
    """Return the page.

    Snapshots, stills and events are of a finished run, and the commands draw the 3-D view. Without snapshots
    the page is a live one, which connects to the server; ``live_cameras`` is whether it will get images of
    the cameras.
    """
    data = {
        "title": scene.name,
        "description": scene.description,
        "legend": [(name, css(colour)) for name, colour in _legend(scene, snapshots)],
        "backgrounds": [[css(colour) for colour in pair] for pair in BACKGROUNDS],
        "inTheDark": {css(light): css(dark) for light, dark in IN_THE_DARK.items()},
        "readings": labels(scene),
        "headings": HEADINGS if scene.coordinated else (),
        "unitReadings": UNIT_READINGS if scene.coordinated else (),
        "colours": {unit: css(colour) for unit, colour in unit_colours(scene).items()},
        # Units between which a reader chooses; the first one is shown at first.
        "choice": moving_units(snapshots) if snapshots and not scene.coordinated else _docking_units(scene),
        "commands": [base64.b64encode(command.data).decode("ascii") for command in commands],
        "replay": replay_data(scene, snapshots, stills, events) if snapshots else None,
        "live": {"stills": _cameras(scene) if live_cameras else [], "stillInterval": 0.0},
    }
    parts = {name: web_file(file) for name, file in _FILES.items()}
    parts |= {"meshcat": viewer_script(), "script": "".join(map(web_file, _SCRIPTS))}
    # "<" is escaped because "</script>" in the description of a scene would end the element that holds it.
    parts["data"] = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], web_file("page.html"))


def web_file(name: str) -> str:
    """Return the text of a file of the folder ``web``."""
    return (files("msrr_bullet.viewer") / "web" / name).read_text(encoding="utf-8")


def _legend(scene: Scene, snapshots: Sequence[Snapshot] | None) -> Sequence[tuple[str, int]]:
    if scene.coordinated:
        return _LEGEND_MISSION
    own: Sequence[tuple[str, int]] = _LEGEND
    if snapshots and all(snapshot.docking_pose is None for snapshot in snapshots):  # a recording
        own = [(name, colour) for name, colour in _LEGEND if colour not in _TRUTH]
    return (*own, *(_LEGEND_OVERHEAD if scene.cameras.overhead is not None else ()))


def _docking_units(scene: Scene) -> Sequence[str]:
    """Return the units that will dock, in the order of the plan."""
    return tuple(scene.units) if scene.coordinated else tuple(dict.fromkeys(s.unit for s in scene.docks))


def _cameras(scene: Scene) -> list[dict[str, Any]]:
    """Return the cameras of a trial that begins."""
    above = () if scene.cameras.overhead is None else (OVERHEAD,)
    return [camera_data(name) for name in (*above, *(onboard_camera(unit) for unit in _docking_units(scene)))]
