"""Gallery of the shipped scenes: runs them, and writes a small picture of each and a page of all pictures.

    python docs/make_gallery.py [SCENE ...]

Without a name all scenes are run, which takes a few minutes. With names only those are run; for the other
scenes the page takes the verdicts that are stored in their pictures.
"""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from msrr_bullet.figures.drawing.perspective import Perspective, on_floor
from msrr_bullet.figures.frames.frame_files import FrameAnnotator
from msrr_bullet.figures.plots.top_view import draw_top_view, extent
from msrr_bullet.log import CameraWindow, Log, read_log
from msrr_bullet.run import run_trial
from msrr_bullet.timeline.camera_views import read_camera_views
from msrr_scenes.as_built import as_designed
from msrr_scenes.camera_lenses import camera_lenses
from msrr_scenes.loading.load import load_scene, shipped_scenes
from msrr_scenes.messages import OVERHEAD, Exposure
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

DOCS = Path(__file__).resolve().parent
PICTURES = DOCS / "gallery"
SEED = 0
#: Size [in] and resolution of a picture [1/in].
SIZE, DPI = (10.0, 2.7), 100

INTRODUCTION = """\
# Gallery of the scenes

This page shows one run of every shipped scene with seed {seed}, most of them by robots that are built with
care. The left picture is the run from above: the path of the docking unit (blue), the path that it believed
in (orange), and the planned path (dashed). Beside it are frames of the cameras as the robot read them: grey
where it read pixels, elsewhere drawn from truth; detected tags are vermillion, the belief is orange, the
line of sight is green, and the bounds of its [cone](glossary.md#terms) are grey. In a mission of many units
each one has a colour of its own: a line shows its way, a pale band the part of its route that was granted
to it, and a black bar a docked pair. [Shipped scenes](reference/scenes.md) lists all in tables.

`msrr dock SCENE --seed {seed}` runs one of them, `msrr frames RUN` draws all of its frames, and
`python docs/make_gallery.py` makes this page.
"""

MANY, FAR, NEAR, WRONG = (
    "Many units",
    "From anywhere in the arena",
    "Docking",
    "What can go wrong",
)
#: Heading of the scenes that `msrr tune` wrote, and the beginning of their names.
TUNED, TUNED_PREFIX = "With tuned parameters", "tuned_"


def choose_exposures(log: Log) -> list[Exposure]:
    """Return two exposures: amid the long-distance phase and late in docking, or early and late.

    Exposures of which windows were read are preferred, because a full frame shows mostly the floor's noise.
    """
    read: dict[Exposure, int] = {}
    for _, record in log.messages(CameraWindow, "/camera/*"):
        read[record.exposure] = read.get(record.exposure, 0) + record.window.area
    by_camera: dict[bool, list[Exposure]] = {True: [], False: []}
    for exposure, area in read.items():
        if area < 0.3 * camera_lenses(log.header.scene)[exposure.camera].camera.frame.area:
            by_camera[exposure.camera == OVERHEAD].append(exposure)
    above, onboard = by_camera[True], by_camera[False]
    if above and onboard:
        return [above[len(above) // 2], onboard[int(0.8 * len(onboard))]]
    found = onboard or above or list(read)
    return [found[len(found) // 3], found[int(0.8 * len(found))]] if found else []


def crop(image: np.ndarray, annotator: FrameAnnotator) -> np.ndarray:
    """Return the part of an overhead frame that contains all bodies, with the aspect ratio of the frame."""
    scene = annotator.context.scene
    x, y = extent(scene, annotator.trial.snapshots)
    corners = Perspective.overhead(scene, as_designed(scene)).pixels(on_floor([[a, b] for a in x for b in y]))
    (u0, v0), (u1, v1) = corners.min(axis=0), corners.max(axis=0)
    height, width = image.shape[:2]
    scale = min(1.0, 1.1 * max((u1 - u0) / width, (v1 - v0) / height))
    w, h = round(scale * width), round(scale * height)
    left = int(np.clip(0.5 * (u0 + u1 - w), 0, width - w))
    top = int(np.clip(0.5 * (v0 + v1 - h), 0, height - h))
    return image[top : top + h, left : left + w]


def draw(log: Log) -> Image.Image:
    """Return the picture of a run."""
    annotator = FrameAnnotator(log)
    frames = [
        (view.exposure.camera, annotator.draw(view)) for view in read_camera_views(log, choose_exposures(log))
    ]
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 0.95))  # room for the captions of tall pictures
    cells = figure.add_gridspec(1, 1 + len(frames), width_ratios=(1.15, *(1.0 for _ in frames)))
    axes = figure.add_subplot(cells[0])
    draw_top_view(axes, log.header.scene, annotator.trial.snapshots, title=False)
    axes.set(xlabel="", ylabel="")
    axes.get_legend().remove()
    for i, (camera, frame) in enumerate(frames):
        axes = figure.add_subplot(cells[1 + i])
        rgb = cv2.cvtColor(frame.image, cv2.COLOR_BGR2RGB)
        axes.imshow(rgb if camera != OVERHEAD else crop(rgb, annotator), interpolation="antialiased")
        axes.set_title(frame.caption, fontsize=8)
        axes.set_axis_off()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    buffer.seek(0)
    return Image.open(buffer).convert("RGB")


def make(name: str, folder: Path) -> None:
    """Run a scene and write its picture, which stores the verdict as text."""
    result = run_trial(load_scene(name), SEED, out=folder)
    image = draw(read_log(folder))
    notes = PngInfo()
    verdict = {
        "outcome": result.outcome.value,
        "duration_s": result.duration_s,
        "attempts": [len(step.attempts) for step in result.steps],
    }
    notes.add_text("msrr", json.dumps(verdict))
    image.save(PICTURES / f"{name}.png", optimize=True, pnginfo=notes)
    print(f"{name}: {result.outcome.value}, {(PICTURES / f'{name}.png').stat().st_size / 1e3:.0f} kB")


def verdict(name: str) -> dict[str, Any]:
    """Return the verdict that the picture of a scene stores: outcome, duration, attempts of every step."""
    with Image.open(PICTURES / f"{name}.png") as image:
        return json.loads(image.text["msrr"])


def chapter(scene: Scene) -> str:
    """Return the heading of the chapter that a scene belongs to."""
    if scene.name.startswith(TUNED_PREFIX):
        return TUNED
    if scene.coordinated:
        return MANY
    spec = scene.cameras.overhead
    far = [s for s in scene.docks if scene.units[s.unit].pose.frame == "world"]
    if spec is not None and far:
        return FAR
    return NEAR if verdict(scene.name)["outcome"] == Outcome.DOCKED.value else WRONG


def page(names: Sequence[str]) -> str:
    """Return the page that shows all pictures."""
    chapters: dict[str, list[str]] = {title: [] for title in (MANY, FAR, NEAR, TUNED, WRONG)}
    for name in names:
        scene, run = load_scene(name), verdict(name)
        counts = " and ".join(str(count) for count in run["attempts"])
        attempts = f", {counts} attempts" if max(run["attempts"], default=1) > 1 else ""
        ending = f"{run['outcome']} after {run['duration_s']:.1f} s{attempts}"
        chapters[chapter(scene)].append(
            f"### `{name}`\n{scene.description} This run: {ending}.\n\n![{name}](gallery/{name}.png)\n"
        )
    parts = [INTRODUCTION.format(seed=SEED)]
    parts += [f"## {title}\n\n" + "\n".join(entries) for title, entries in chapters.items() if entries]
    return "\n".join(parts)


def main(arguments: Sequence[str]) -> None:
    """Make the pictures of the scenes named, or of all, and the page."""
    names = shipped_scenes()
    PICTURES.mkdir(exist_ok=True)
    for name in arguments or names:
        with TemporaryDirectory() as folder:
            make(name, Path(folder))
    (DOCS / "gallery.md").write_text(page(names), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
