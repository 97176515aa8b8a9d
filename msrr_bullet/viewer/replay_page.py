"""Page that replays a finished trial: one file that needs neither a server nor a network."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from msrr_bullet.log.records import Event
from msrr_bullet.timeline.snapshot import Snapshot, planned_paths, step_histories
from msrr_bullet.timeline.still import Still
from msrr_bullet.viewer.arena_belief import PLAN_NODE, plan_commands
from msrr_bullet.viewer.commands import Command, KeyframeTrack, NodeState, set_animation
from msrr_bullet.viewer.page import render_page
from msrr_bullet.viewer.scene_graph import PATH_STEP, SceneGraph, look_at, path_commands, places
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, Phase, seconds
from msrr_scenes.specs.scene import Scene
from msrr_scenes.whole_files import write_whole

#: Rate at which the page stores snapshots of the trial, between which it interpolates [Hz].
SNAPSHOT_RATE = 25.0


def write_replay(
    path: Path,
    scene: Scene,
    snapshots: Iterable[Snapshot],
    stills: Iterable[Still] = (),
    events: Iterable[Event] = (),
) -> Path:
    """Write a self-contained page that replays a trial, and return the path of the file.

    All is in order of time, stills for each camera. Of snapshots, at any rate, about :data:`SNAPSHOT_RATE`
    are kept.

    Raises:
        MsrrError: There is no snapshot.
    """
    kept = tuple(_thinned(snapshots))
    if not kept:
        raise MsrrError(f"{path}: a trial without a single snapshot has nothing to replay")
    graph = SceneGraph(scene)
    drawn, tracks = graph.mission.replay(kept) if scene.coordinated else _paths(kept)
    commands = [*graph.build(), *drawn, *look_at(places(kept)), _animation(graph, kept, tracks)]
    write_whole(path, render_page(scene, commands, kept, stills, events))
    return path


def _thinned(snapshots: Iterable[Snapshot]) -> Iterator[Snapshot]:
    """Yield the snapshots at :data:`SNAPSHOT_RATE`, at every change of phase, and the last one."""
    due, last, kept = 0, None, None
    for last in snapshots:
        if kept is None or last.stamp_ns >= due or _phases(last) != _phases(kept):
            yield last
            kept, due = last, last.stamp_ns + round(NS_PER_S / SNAPSHOT_RATE)
    if last is not None and last is not kept:
        yield last


def _phases(snapshot: Snapshot) -> list[Phase | None]:
    return [step.phase for step in snapshot.steps]


def _pieces(poses: Iterable[SE2 | None]) -> Iterator[list[Array]]:
    """Yield the pieces of a path, each a list of points (2,) in W [m]; a piece ends at an unknown pose."""
    piece: list[Array] = []
    for pose in poses:
        if pose is None:
            if piece:
                yield piece
            piece = []
        elif not piece or np.linalg.norm(pose.translation - piece[-1]) >= PATH_STEP:
            piece.append(pose.translation)
    if piece:
        yield piece


def _paths(snapshots: Sequence[Snapshot]) -> tuple[list[Command], list[KeyframeTrack]]:
    """Return the commands that draw all paths, and the times at which each planned one is followed."""
    commands: list[Command] = []
    tracks: list[KeyframeTrack] = []
    times = _times(snapshots)
    histories = step_histories(snapshots)
    driven = [[at.units.get(step.unit) for at, _ in history] for step, history in histories.items()]
    believed = [[s.estimate for _, s in history] for history in histories.values()]
    for name, steps in (("truth", driven), ("belief", believed)):
        for i, piece in enumerate(piece for poses in steps for piece in _pieces(poses)):
            commands += path_commands(f"{name}_{i}", piece)
    for i, plan in enumerate(planned_paths(snapshots)):
        commands += plan_commands(f"{PLAN_NODE}/{i}", plan.points)
        followed = np.array([any(step.path is plan for step in s.steps) for s in snapshots])
        tracks.append(KeyframeTrack(f"{PLAN_NODE}/{i}", "visible", "bool", times, followed))
    return commands, tracks


def _times(snapshots: Sequence[Snapshot]) -> Array:
    return np.array([seconds(snapshot.stamp_ns) for snapshot in snapshots])


def _animation(graph: SceneGraph, snapshots: Sequence[Snapshot], paths: Sequence[KeyframeTrack]) -> Command:
    """Return the animation of everything that moves, and of the paths that are not always shown."""
    times = _times(snapshots)
    node_states = [graph.node_states(snapshot) for snapshot in snapshots]
    tracks: list[KeyframeTrack] = []
    for node in node_states[0]:
        tracks += _tracks(node, times, _held([by_node[node] for by_node in node_states]))
    return set_animation([track.thinned() for track in (*tracks, *paths)])


def _held(history: Sequence[NodeState]) -> list[NodeState]:
    """Return a history in which a node stays where it was when it was hidden.

    The page moves it from one instant to the next, and hides it only at the end of that way.
    """
    held, last = [], next((p for p in history if p.visible), history[0])
    for state in history:
        last = state if state.visible else replace(last, visible=False)
        held.append(last)
    return held


def _tracks(node: str, times: Array, history: Sequence[NodeState]) -> list[KeyframeTrack]:
    visible = np.array([p.visible for p in history])
    quaternions = np.array([p.X.quaternion_xyzw() for p in history])
    # q and -q are the same rotation, but interpolation from one to the other would turn the long way round.
    flips = np.cumprod(np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    quaternions[1:] *= flips[:, None]
    return [
        KeyframeTrack(node, "visible", "bool", times, visible),
        KeyframeTrack(node, "position", "vector3", times, np.array([p.X.p for p in history])),
        KeyframeTrack(node, "quaternion", "quaternion", times, quaternions),
        KeyframeTrack(node, "scale", "vector3", times, np.array([p.scale for p in history])),
    ]
