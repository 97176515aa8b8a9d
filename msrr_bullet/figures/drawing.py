"""What the two kinds of annotated frame have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from msrr_bullet.figures.canvas import Canvas, Image, Key, framed
from msrr_bullet.figures.perspective import Perspective, Solids, bodies
from msrr_bullet.figures.schematic import draw_scene
from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.palette import DETECTION, GRID, WINDOW
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_perception.pose.target import TargetModel
from msrr_scenes.messages import seconds
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

#: Width of an annotated frame that is worth reaching by enlarging small ones [px].
WIDTH = 1280

READ_KEY = Key(WINDOW, "window read (elsewhere: drawn from truth)")
DETECTION_KEY = Key(DETECTION, "tag detected")


@dataclass(frozen=True, eq=False)
class DrawingContext:
    """What frames are drawn with, made once per run.

    Attributes:
        scene: The scene of the run.
        seed: Its seed.
    """

    scene: Scene
    seed: int

    @cached_property
    def solids(self) -> Mapping[str, Solids]:
        """Every body of the scene."""
        return bodies(self.scene)

    @cached_property
    def targets(self) -> Mapping[DockStep, TargetModel]:
        """The docking unit's map of its target, for each step of the plan."""
        return {step: TargetModel.from_scene(self.scene, step) for step in self.scene.plan}


@dataclass(frozen=True, eq=False)
class Picture:
    """An annotated frame.

    Attributes:
        stamp_ns: Its time.
        image: BGR, shape (height, width, 3), without words around it.
        title: Lines of text above it.
        caption: The same in a few words.
        legend: What its colours mean.
    """

    stamp_ns: int
    image: Image
    title: tuple[str, ...]
    caption: str
    legend: tuple[Key, ...]

    def framed(self) -> Image:
        """Return the frame with its words."""
        return framed(self.image, self.title, self.legend)


def prepared(stagecraft: DrawingContext, view: CameraView, look: Perspective, moment: Snapshot) -> Canvas:
    """Return the frame: its pixels where they were read, elsewhere a drawing; windows and tags outlined."""
    camera = view.camera
    canvas = Canvas(camera.width, camera.height, max(1, WIDTH // camera.width), GRID)
    poses = {**moment.units, **moment.obstacles}
    own = moment.step.unit if moment.step and view.exposure.camera.startswith(moment.step.unit) else None
    draw_scene(canvas, look, stagecraft.scene.arena, stagecraft.solids, poses, own)
    frame, read = view.mosaic()
    canvas.paste(frame, read)
    for window, _ in view.windows:
        x0, y0, x1, y1 = window.x - 0.5, window.y - 0.5, window.x_end - 0.5, window.y_end - 0.5
        canvas.line([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], WINDOW, 1, closed=True)
    for tag in view.tags:
        canvas.line(tag.corners, DETECTION, 2, closed=True)
        canvas.text([tag.corners[:, 0].mean(), tag.corners[:, 1].min()], str(tag.tag_id), DETECTION)
    return canvas


def heading(stagecraft: DrawingContext, view: CameraView, moment: Snapshot) -> tuple[str, str]:
    """Return the lines that say what, when and in which phase."""
    scene, exposure = stagecraft.scene, view.exposure
    frame = f"frame {exposure.frame}" if exposure.frame >= 0 else "not looking"
    first = f"{scene.name}, seed {stagecraft.seed}    {exposure.camera}, {frame}    {_time(view)}"
    if moment.phase is None:
        return first, "before the first decision"
    phase = moment.phase.value.replace("_", " ")
    if moment.assembly is not None:
        phase += f", {moment.assembly.stage}"
    reason = moment.assembly.reason if moment.assembly is not None else moment.reason
    return first, f"attempt {moment.attempt}, {phase}: {reason}"


def caption(view: CameraView, moment: Snapshot) -> str:
    """Return time and phase in a few words."""
    phase = moment.phase.value.replace("_", " ") if moment.phase else ""
    return f"{_time(view)} {phase}, {view.exposure.camera}"


def _time(view: CameraView) -> str:
    return f"{seconds(view.stamp_ns):.2f} s"


def looked_at(view: CameraView) -> str:
    """Say what was found, and how much of the frame was read for it."""
    if view.exposure.frame < 0:
        return "drawn from truth alone"
    read = 100.0 * float(view.mosaic()[1].mean())
    tags, windows = _counted(len(view.tags), "tag"), _counted(len(view.windows), "window")
    return f"{tags} found, read {read:.0f} % of the frame in {windows}"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
