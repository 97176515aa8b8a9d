"""Common parts of annotated frames of both cameras: pixels, windows, tags, and the text above them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from msrr_bullet.figures.drawing.canvas import PAPER, TABLE_WIDTH, Canvas, Image, Key, on_paper, table, titled
from msrr_bullet.figures.drawing.perspective import Perspective, Solids, scene_solids
from msrr_bullet.figures.drawing.schematic import Drawing, draw_scene
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.mission_snapshot import Activity
from msrr_bullet.timeline.mission_table import UnitRow, mission_text, unit_rows
from msrr_bullet.timeline.palette import DETECTION, GRID, WINDOW, unit_colours
from msrr_bullet.timeline.routes import Routes
from msrr_bullet.timeline.series import port_in_dock
from msrr_bullet.timeline.snapshot import Snapshot, phase_name
from msrr_perception.pose.target import TargetModel
from msrr_scenes.as_built import AsBuilt, as_designed, draw_as_built
from msrr_scenes.geometry.lens import frame_outline
from msrr_scenes.messages import OVERHEAD, Exposure, Phase, carrier_of, seconds
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.wording import counted

#: Width up to which small frames are enlarged [px].
WIDTH = 1280

#: Phases in which nothing happens any more.
_ENDS = (Phase.DONE, Phase.FAILED)

#: Headings of the table of the units of a mission.
_HEADINGS = ("", "does", "to", "driven/granted/route", "waits")

READ_KEY = Key(WINDOW, "window read (elsewhere: drawn from truth)")
RECORDED_KEY = Key(WINDOW, "window read (elsewhere: drawn from the estimate)")
DETECTION_KEY = Key(DETECTION, "tag detected")


@dataclass(frozen=True, eq=False)
class DrawingContext:
    """Scene and models with which the frames of a run are drawn, built once per run.

    Attributes:
        scene: Scene of the run.
        seed: Seed of the run; None for a recording.
    """

    scene: Scene
    seed: int | None
    _targets: dict[DockStep, TargetModel] = field(default_factory=dict, init=False, repr=False)

    @property
    def origin(self) -> str:
        """Name of the scene, and the seed of the run or that it is a recording, in words."""
        return f"{self.scene.name}, {'recording' if self.seed is None else f'seed {self.seed}'}"

    @cached_property
    def built(self) -> AsBuilt:
        """What was not as the scene says; of a recording nobody knows."""
        return as_designed(self.scene) if self.seed is None else draw_as_built(self.scene, self.seed)

    @cached_property
    def solids(self) -> Mapping[str, Solids]:
        """Solids of every body of the scene by name."""
        return scene_solids(self.scene, self.built)

    @cached_property
    def colours(self) -> Mapping[str, int]:
        """Colour of every unit by name."""
        return unit_colours(self.scene)

    @cached_property
    def top_tags_m(self) -> float:
        """Height of the highest top tag of a unit [m], where lines in an overhead frame are drawn; else 0."""
        units = map(self.scene.geometry, self.scene.units)
        return max((float(u.frame("tag_top").p[2]) for u in units if "tag_top" in u.tag_slots), default=0.0)

    @cached_property
    def routes(self) -> Routes:
        """Routes that the base station has granted."""
        return Routes(self.scene)

    def instant(self, exposure: Exposure) -> int:
        """Return the middle of an exposure by the clock of the simulation, which that of the camera is off.

        A view without a frame, of which the number is negative, has its time by that clock.
        """
        if exposure.frame < 0:
            return exposure.stamp_ns
        unit = carrier_of(exposure.camera)
        camera = self.built.overhead if unit is None else self.built.units[unit].camera
        return exposure.stamp_ns if camera is None else camera.instant(exposure.stamp_ns)

    def target(self, step: DockStep) -> TargetModel:
        """Return the model that the docking unit has of its target in a step."""
        if step not in self._targets:
            self._targets[step] = TargetModel.from_scene(self.scene, step)
        return self._targets[step]


@dataclass(frozen=True, eq=False)
class AnnotatedFrame:
    """Camera frame with drawings on it.

    Attributes:
        image: BGR image, shape (height, width, 3), without text around it.
        title: Lines of text above the image.
        caption: Short title.
        legend: Meanings of the colours.
        table: Rows of the table of the units of a mission, each with the colour of its unit.
    """

    image: Image
    title: tuple[str, ...]
    caption: str
    legend: tuple[Key, ...]
    table: tuple[tuple[int, tuple[str, ...]], ...] = ()

    def titled(self) -> Image:
        """Return the image with title and legend, and the table at its right."""
        image = titled(self.image, self.title, self.legend)
        if not self.table:
            return image
        beside = on_paper(table(self.table, TABLE_WIDTH), TABLE_WIDTH, len(image))
        return np.concatenate([image, beside], axis=1)


def draw_frame(
    context: DrawingContext, view: CameraView, perspective: Perspective, snapshot: Snapshot
) -> Drawing:
    """Draw a frame: its pixels where they were read, a schematic elsewhere, and outlines of windows and tags.

    It is drawn as the ideal camera would see it, with the trial at the time of exposure.
    """
    camera = view.camera
    canvas = Canvas(camera.width, camera.height, max(1, WIDTH // camera.width), GRID)
    poses = {**snapshot.units, **snapshot.obstacles}
    own = carrier_of(view.exposure.camera)
    drawing = Drawing(canvas, perspective)
    draw_scene(drawing, context.scene.arena, context.solids, poses, own)
    frame, read = view.mosaic()
    canvas.paste(frame, read)
    for window, _ in view.windows:
        canvas.line(view.lens.undistorted(frame_outline(window)), WINDOW, 1, closed=True)
    for tag in view.tags:
        canvas.line(tag.corners, DETECTION, 2, closed=True)
        canvas.text([tag.corners[:, 0].mean(), tag.corners[:, 1].min()], str(tag.tag_id), DETECTION)
    return drawing


def annotate(
    context: DrawingContext,
    view: CameraView,
    snapshot: Snapshot,
    drawing: Drawing,
    details: str,
    legend: Sequence[Key],
) -> AnnotatedFrame:
    """Return a drawn frame with three title lines: scene and time, phase, detections and details."""
    time, exposure = f"{seconds(view.stamp_ns):.2f} s", view.exposure
    number = f"frame {exposure.frame}" if exposure.frame >= 0 else "not looking"
    first = f"{context.origin}    {exposure.camera}, {number}    {time}"
    of_mission = snapshot.mission is not None and exposure.camera == OVERHEAD
    second = state_text(context, snapshot if of_mission else replace(snapshot, mission=None))
    caption = f"{time}, {exposure.camera}"
    if snapshot.first.phase is not None and not of_mission:
        caption = f"{time} {phase_name(snapshot.first.phase)}, {exposure.camera}"
    title = (first, second, "; ".join(filter(None, (_detection_text(context, view), details))))
    rows = unit_rows(snapshot) if exposure.camera == OVERHEAD else []
    return AnnotatedFrame(
        drawing.canvas.image,
        title,
        caption,
        tuple(legend),
        ((PAPER, _HEADINGS), *((context.colours[row.unit], _cells(row)) for row in rows)) if rows else (),
    )


def state_text(context: DrawingContext, snapshot: Snapshot) -> str:
    """Return in words how a mission stands, or what the first unit under way does and believes."""
    if snapshot.mission is not None:
        return mission_text(snapshot.mission)
    present = _present_text(context.scene, snapshot)
    if context.seed is None:
        return present
    if snapshot.first.phase is None:
        return "before the first decision"
    return f"attempt {snapshot.first.attempt}, {snapshot.first.phase_text}: {present}"


def _cells(row: UnitRow) -> tuple[str, ...]:
    """Return what the table beside a frame shows of a unit; reasons would be too long for it."""
    waits = f"then {row.waits_for}" if row.waits_for else ""
    if row.does.startswith(Activity.WAITING.value):
        waits = f"for {row.waits_for}"
    return row.unit, row.does, row.task, row.route, waits


def _present_text(scene: Scene, snapshot: Snapshot) -> str:
    """Return in words where the unit believes it is and how it moves, or how it ended.

    The reason of the phase is of its beginning, and soon stale. It is given only where it stays true: as what
    led to a retreat or an end.
    """
    first = snapshot.first
    if first.phase in _ENDS:
        return first.reason
    gap, lateral, heading = port_in_dock(scene, snapshot, first.estimate)
    text = "no estimate of the target"
    if math.isfinite(gap):
        text = f"believed at {1e3 * gap:z.0f} mm, lateral {1e3 * lateral:+z.1f} mm, "
        text += f"heading {math.degrees(heading):+z.1f} deg"
    if first.twist is not None:
        text += f"; {first.twist.v:+z.2f} m/s"
    return f"{text}; after {first.reason}" if first.phase is Phase.RETREAT else text


def _detection_text(context: DrawingContext, view: CameraView) -> str:
    """Return how many tags were found, and how much of the frame was read, in words."""
    if view.exposure.frame < 0:
        return f"drawn from {'the estimate' if context.seed is None else 'truth'} alone"
    tags, windows = counted(len(view.tags), "tag"), counted(len(view.windows), "window")
    found = f"{tags} found" if view.complete else "tags not reported before the end"
    return f"{found}, read {100.0 * view.read_share:.0f} % of the frame in {windows}"
