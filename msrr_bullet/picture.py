"""One picture of a trial: the paths from above, the errors and angles over time, what the camera saw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from msrr_bullet.footprint import Part, obstacle_parts, unit_parts
from msrr_bullet.viewer.palette import (
    BELIEF,
    DARK,
    DOCKING_UNIT,
    GREEN,
    OBSTACLE,
    PATH,
    PHASE_COLOURS,
    VERMILLION,
    css,
    unit_colour,
)
from msrr_bullet.viewer.snapshot import Snapshot
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import LosStatus, Phase, TagDetection, seconds
from msrr_scenes.pinhole import PinholeCamera, Window
from msrr_scenes.scene import Scene
from msrr_scenes.se2 import SE2

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

#: Size [in] and resolution [1/in] of the picture.
SIZE, DPI = (12.0, 7.2), 130
#: Grey level of the pixels that perception never asked for.
UNREAD = 200


@dataclass(frozen=True, slots=True, eq=False)
class OnboardView:
    """What perception read of one frame.

    Attributes:
        stamp_ns: Time of exposure.
        camera: Its optics.
        windows: The windows read, each with its mono8 pixels (height, width).
        tags: What was detected, corners in full-frame pixels.
    """

    stamp_ns: int
    camera: PinholeCamera
    windows: Sequence[tuple[Window, Pixels]]
    tags: Sequence[TagDetection] = ()


def write_picture(
    path: Path,
    scene: Scene,
    frames: Sequence[Snapshot],
    onboard: Sequence[OnboardView] = (),
    headline: str = "",
) -> Path:
    """Write a PNG that sums a trial up; return its path.

    Args:
        path: File to write.
        scene: The scene of the trial.
        frames: Instants in order, at any rate.
        onboard: At most three views of the docking unit's camera.
        headline: Such as the outcome.

    Raises:
        MsrrError: There is not a single frame.
    """
    if not frames:
        raise MsrrError(f"{path}: a trial without a single frame gives no picture")
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    views = tuple(onboard)[:3]
    columns = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    left, right = columns[0], columns[1]
    if views:
        rows = left.subgridspec(2, 1, height_ratios=(1.7, 1.0))
        cells = rows[1].subgridspec(1, len(views))
        for i, view in enumerate(views):
            _onboard(figure.add_subplot(cells[i]), view, frames[0].stamp_ns)
        left = rows[0]
    _top_view(figure.add_subplot(left), scene, frames)
    curves = right.subgridspec(3, 1)
    sight = figure.add_subplot(curves[2])
    lateral, yaw = (figure.add_subplot(curves[i], sharex=sight) for i in (0, 1))
    for axes in (lateral, yaw):
        axes.tick_params(labelbottom=False)
    _errors(lateral, yaw, scene, frames)
    _sight(sight, scene, frames)
    for axes in (lateral, yaw, sight):
        _shade_phases(axes, frames, named=axes is lateral)
    sight.set_xlabel("time [s]")
    figure.suptitle(f"{scene.name}{f': {headline}' if headline else ''}", fontsize=13, fontweight="bold")
    figure.savefig(path, metadata={"Software": None})
    return path


def _patch(part: Part, X_WB: SE2) -> Polygon | Circle:
    core = X_WB.act(part.core)
    if len(core) == 1:
        return Circle((float(core[0, 0]), float(core[0, 1])), part.radius)
    return Polygon([(float(x), float(y)) for x, y in core])


def _body(axes: Axes, parts: Sequence[Part], X_WB: SE2, colour: int, alpha: float) -> None:
    for part in parts:
        patch = _patch(part, X_WB)
        patch.set(facecolor=css(colour), edgecolor=css(DARK), linewidth=0.8, alpha=alpha)
        axes.add_patch(patch)


def _marks(frames: Sequence[Snapshot]) -> list[tuple[str, Snapshot]]:
    """Return the instants at which the docking units are drawn: start, end of every docking run, end."""
    marks = [("start", frames[0])]
    for before, after in pairwise(frames):
        if before.phase is Phase.DOCK and after.phase is not Phase.DOCK:
            marks.append((f"end of run {before.attempt}", before))
    return [*marks, ("end", frames[-1])]


def _top_view(axes: Axes, scene: Scene, frames: Sequence[Snapshot]) -> None:
    docking = {step.unit for step in scene.plan}
    last = frames[-1]
    for name, X in last.obstacles.items():
        _body(axes, obstacle_parts(scene.obstacles[name]), X, OBSTACLE, 1.0)
    for index, (name, X) in enumerate(last.units.items()):
        if name not in docking:
            _body(axes, unit_parts(scene.geometry(name)), X, unit_colour(index, docks=False), 1.0)
    marks = _marks(frames)
    for i, (_, frame) in enumerate(marks):
        for name in docking & frame.units.keys():
            opacity = 0.25 + 0.65 * i / (len(marks) - 1)
            _body(axes, unit_parts(scene.geometry(name)), frame.units[name], DOCKING_UNIT, opacity)
    acting = [(f, f.units.get(f.step.unit) if f.step else None) for f in frames]
    truth = np.array([(X.x, X.y) if X else (np.nan, np.nan) for _, X in acting])
    belief = np.array([(f.estimate.x, f.estimate.y) if f.estimate else (np.nan, np.nan) for f in frames])
    axes.plot(*truth.T, color=css(PATH), linewidth=2.2, label="driven (truth)")
    axes.plot(*belief.T, color=css(BELIEF), linewidth=1.1, label="believed")
    for name, X in frames[0].units.items():
        axes.annotate(name, (X.x, X.y), ha="center", va="center", fontsize=10, fontweight="bold")
    axes.set(xlabel="x in W [m]", ylabel="y in W [m]", aspect="equal")
    axes.autoscale_view()
    axes.margins(0.08)
    axes.grid(True, color="#e4e7ea", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.legend(loc="upper left", fontsize=8, framealpha=0.9)
    axes.set_title("from above: " + ", ".join(name for name, _ in marks), fontsize=9)


def _times(frames: Sequence[Snapshot]) -> Array:
    return np.array([seconds(frame.stamp_ns - frames[0].stamp_ns) for frame in frames])


def _in_dock(scene: Scene, frame: Snapshot, X_WU: SE2 | None) -> tuple[float, float]:
    """Return the front port's lateral offset [m] and the heading [rad] in the target's dock frame D."""
    step = frame.step
    if step is None or X_WU is None or step.target_unit not in frame.units:
        return math.nan, math.nan
    X_WD = frame.units[step.target_unit] @ scene.geometry(step.target_unit).dock_frame(step.target_port)
    X_DP = X_WD.inverse() @ X_WU @ scene.geometry(step.unit).port(step.port)
    return X_DP.y, X_DP.yaw


def _errors(lateral: Axes, yaw: Axes, scene: Scene, frames: Sequence[Snapshot]) -> None:
    times = _times(frames)
    truth = np.array([_in_dock(scene, f, f.units.get(f.step.unit) if f.step else None) for f in frames])
    belief = np.array([_in_dock(scene, f, f.estimate) for f in frames])
    for axes, column, scale in ((lateral, 0, 1e3), (yaw, 1, math.degrees(1.0))):
        # Belief lies thin on top of truth: both show where they agree.
        axes.plot(times, scale * truth[:, column], color=css(PATH), linewidth=2.6, label="truth")
        axes.plot(times, scale * belief[:, column], color=css(BELIEF), linewidth=1.0, label="believed")
        axes.axhline(0.0, color=css(DARK), linewidth=0.6)
        _frame_curves(axes)
    lateral.set_ylabel("lateral [mm]")
    lateral.legend(loc="best", fontsize=8)
    yaw.set_ylabel("yaw [deg]")
    lateral.set_title("front port in the target's dock frame; line of sight", fontsize=9, pad=16)


def _sight(axes: Axes, scene: Scene, frames: Sequence[Snapshot]) -> None:
    times = _times(frames)
    for status, style in ((LosStatus.SEEN, "-"), (LosStatus.PREDICTED, ":")):
        angles = np.array(
            [
                (f.los.left, f.los.right) if f.los and f.los.status is status else (np.nan, np.nan)
                for f in frames
            ]
        )
        for column, colour, side in ((0, GREEN, "left edge"), (1, VERMILLION, "right edge")):
            axes.plot(
                times,
                np.degrees(angles[:, column]),
                style,
                color=css(colour),
                label=f"{side}, {status.value}",
            )
    half_fov = math.degrees(scene.cameras.onboard.pinhole.half_fov)
    for limit, style, name in (
        (scene.los.inner_deg, "--", "inner"),
        (scene.los.outer_deg, "-.", "outer"),
        (half_fov, "-", "field of view"),
    ):
        for sign in (1.0, -1.0):
            axes.axhline(sign * limit, color=css(DARK), linestyle=style, linewidth=0.8)
        axes.annotate(
            name, (1.0, limit), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7
        )
    axes.set(ylabel="edge angle [deg]", ylim=(-1.2 * half_fov, 1.2 * half_fov))
    _frame_curves(axes)
    axes.legend(loc="lower left", fontsize=7, ncols=2)


def _frame_curves(axes: Axes) -> None:
    axes.grid(True, color="#e4e7ea", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)


def _shade_phases(axes: Axes, frames: Sequence[Snapshot], named: bool) -> None:
    times = _times(frames)
    start = 0
    for phase, run in groupby(frames, key=lambda frame: frame.phase):
        stop = start + len(list(run))
        t0, t1 = float(times[start]), float(times[min(stop, len(times) - 1)])
        start = stop
        if phase is None:
            continue
        axes.axvspan(t0, t1, color=css(PHASE_COLOURS[phase]), linewidth=0.0, alpha=0.6, zorder=0)
        # A name needs room; short phases are told by their colour and their neighbours.
        if named and t1 - t0 > 0.06 * times[-1]:
            axes.annotate(
                phase.value.replace("_", " "),
                (0.5 * (t0 + t1), 1.02),
                xycoords=("data", "axes fraction"),
                ha="center",
                fontsize=7,
            )
    axes.set_xlim(float(times[0]), float(times[-1]) or 1.0)


def _onboard(axes: Axes, view: OnboardView, start_ns: int) -> None:
    frame = np.full((view.camera.height, view.camera.width), UNREAD, dtype=np.uint8)
    for window, pixels in view.windows:
        frame[window.y : window.y_end, window.x : window.x_end] = pixels
    axes.imshow(frame, cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
    for tag in view.tags:
        axes.add_patch(
            Polygon([(float(x), float(y)) for x, y in tag.corners], fill=False, edgecolor=css(VERMILLION))
        )
        middle = tag.corners.mean(axis=0)
        axes.annotate(
            str(tag.tag_id),
            (float(middle[0]), float(middle[1])),
            color=css(VERMILLION),
            fontsize=7,
            ha="center",
        )
    axes.set_title(
        f"onboard, {seconds(view.stamp_ns - start_ns):.2f} s, tags found: {len(view.tags)}", fontsize=8
    )
    axes.set_axis_off()
