"""The page that replays a finished trial: one file, no server, no network."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from msrr_bullet.timeline.palette import PHASE_COLOURS, css
from msrr_bullet.timeline.snapshot import Snapshot, planned_paths
from msrr_bullet.viewer.arena_belief import PLAN_NODE, plan_commands
from msrr_bullet.viewer.commands import Command, Track, set_animation
from msrr_bullet.viewer.nodes import Placement
from msrr_bullet.viewer.page import PhaseSpan, Timeline, readings, render_page
from msrr_bullet.viewer.scene_graph import PATH_STEP, SceneGraph, look_at
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, seconds
from msrr_scenes.specs.scene import Scene

#: Frames per second of trial that the page keeps; it interpolates between them.
FRAME_RATE = 25.0


def write_replay(path: Path, scene: Scene, frames: Iterable[Snapshot]) -> Path:
    """Write a self-contained page that replays a trial; return its path.

    Args:
        path: File to write, such as ``run/replay.html``.
        scene: The scene of the trial.
        frames: Instants in order, at any rate; about :data:`FRAME_RATE` per second are kept, and the last.

    Raises:
        MsrrError: There is not a single frame.
    """
    kept = tuple(_thin(frames))
    if not kept:
        raise MsrrError(f"{path}: a trial without a single frame has nothing to replay")
    graph = SceneGraph(scene)
    commands = [*graph.build(), *_paths(graph, kept), *_view(kept), _animation(graph, kept)]
    path.write_text(render_page(scene, commands, _timeline(kept)), encoding="utf-8")
    return path


def _thin(frames: Iterable[Snapshot]) -> Iterator[Snapshot]:
    due, last, kept = 0, None, None
    for frame in frames:
        # A change of phase is kept too: attempts and outcomes hang on it.
        if kept is None or frame.stamp_ns >= due or frame.phase is not kept.phase:
            yield frame
            kept, due = frame, frame.stamp_ns + round(NS_PER_S / FRAME_RATE)
        last = frame
    if last is not None and last is not kept:
        yield last


def docking_path(frames: Iterable[Snapshot], believed: bool) -> Iterator[list[Array]]:
    """Yield the pieces of the docking unit's path, each a list of points (2,) [m] of W.

    A piece ends where another unit takes over and where there is no estimate.
    """
    piece: list[Array] = []
    unit: str | None = None
    for frame in frames:
        acting = frame.step.unit if frame.step else None
        pose: SE2 | None = frame.estimate if believed else frame.units.get(acting or "")
        if piece and (acting != unit or pose is None):
            yield piece
            piece = []
        unit = acting
        if acting is None or pose is None:
            continue
        if not piece or np.linalg.norm(pose.translation - piece[-1]) >= PATH_STEP:
            piece.append(pose.translation)
    if piece:
        yield piece


def _paths(graph: SceneGraph, frames: Sequence[Snapshot]) -> Iterator[Command]:
    for name, believed in (("truth", False), ("belief", True)):
        for i, piece in enumerate(docking_path(frames, believed)):
            yield from graph.path_commands(f"{name}_{i}", piece)
    for i, plan in enumerate(planned_paths(frames)):
        yield from plan_commands(f"{PLAN_NODE}/{i}", plan.points)


def _view(frames: Sequence[Snapshot]) -> Iterator[Command]:
    poses = [X for frame in frames for X in (*frame.units.values(), *frame.obstacles.values())]
    if poses:
        yield from look_at(np.array([[X.x, X.y] for X in poses]))


def _animation(graph: SceneGraph, frames: Sequence[Snapshot]) -> Command:
    times = np.array([seconds(frame.stamp_ns - frames[0].stamp_ns) for frame in frames])
    instants = [graph.placements(frame) for frame in frames]
    tracks: list[Track] = []
    for node in instants[0]:
        tracks += _tracks(node, times, [placements[node] for placements in instants])
    for i, plan in enumerate(planned_paths(frames)):
        followed = np.array([frame.path is plan for frame in frames])
        tracks.append(Track(f"{PLAN_NODE}/{i}", "visible", "bool", times, followed))
    return set_animation([track.thinned() for track in tracks])


def _tracks(node: str, times: Array, history: Sequence[Placement]) -> list[Track]:
    visible = np.array([p.visible for p in history])
    quaternions = np.array([p.X.quaternion_xyzw() for p in history])
    # q and -q are one rotation, but the page would turn the long way round between them.
    flips = np.cumprod(np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    quaternions[1:] *= flips[:, None]
    return [
        Track(node, "visible", "bool", times, visible),
        Track(node, "position", "vector3", times, np.array([p.X.p for p in history])),
        Track(node, "quaternion", "quaternion", times, quaternions),
        Track(node, "scale", "vector3", times, np.array([p.scale for p in history])),
    ]


def _timeline(frames: Sequence[Snapshot]) -> Timeline:
    start = frames[0].stamp_ns
    times = [seconds(frame.stamp_ns - start) for frame in frames]
    spans: list[PhaseSpan] = []
    begin = 0
    for i in range(1, len(frames) + 1):
        phase = frames[begin].phase
        if i == len(frames) or frames[i].phase is not phase:
            end = times[min(i, len(frames) - 1)]
            if phase is not None:
                spans.append(
                    PhaseSpan(phase.value.replace("_", " "), times[begin], end, css(PHASE_COLOURS[phase]))
                )
            begin = i
    return Timeline(times, [readings(frame) for frame in frames], spans)
