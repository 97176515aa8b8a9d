"""Live view of a running trial in a browser, served on loopback by a process that ends with this one."""

from __future__ import annotations

import json
import logging
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from msrr_bullet.timeline.camera_views import CameraView
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.viewer import server
from msrr_bullet.viewer.arena_belief import LIVE_PLAN_NODE, plan_commands
from msrr_bullet.viewer.commands import Command, NodeState, place
from msrr_bullet.viewer.growing_path import GrowingPath
from msrr_bullet.viewer.live_cameras import LiveCameras, StillDrawer
from msrr_bullet.viewer.page import render_page
from msrr_bullet.viewer.readings import labels, readings, unit_readings
from msrr_bullet.viewer.replay_data import camera_data
from msrr_bullet.viewer.scene_graph import SceneGraph, framed, look_at, path_commands, places
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import NS_PER_S, AssemblyPath, seconds
from msrr_scenes.specs.scene import Scene

_log = logging.getLogger(__name__)

DEFAULT_PORT = 7000
#: Largest rate at which snapshots are shown, in wall-clock time [Hz].
MAX_RATE = 30.0
#: Distance from the middle of what is shown, by its radius, from which on a body is out of view; and what is
#: shown beyond such a body, which may drive on [m].
_OUT_OF_VIEW, _BEYOND_M = 1.1, 0.4
#: Time limits for the server to start, to read, and to end [s].
START_TIMEOUT, WRITE_TIMEOUT, CLOSE_TIMEOUT = 20.0, 5.0, 2.0


class ViewerError(MsrrError):
    """The live view could not start or was interrupted."""


class _LostError(ViewerError):
    """The server has ended, or no longer reads."""


class LiveViewer:
    """Viewer that shows a trial in the browser while it runs. Use it in a ``with`` block.

    The server is a separate process that reads from a pipe. It ends when the viewer is closed, and also when
    this process ends in any other way, because the pipe closes then.
    """

    def __init__(
        self,
        scene: Scene,
        port: int = DEFAULT_PORT,
        pace: float | None = None,
        drawer: StillDrawer | None = None,
    ) -> None:
        """Start the server, which serves the page at :attr:`url`.

        Args:
            scene: Scene of the trial.
            port: Port on 127.0.0.1. If it is taken, any free one is used.
            pace: Largest number of simulated seconds per second of wall-clock time; None sets no limit.
            drawer: Draws the images of the cameras; None shows none.

        Raises:
            ViewerError: The server did not start.
        """
        self._graph = SceneGraph(scene)
        self._pace, self._labels = pace, labels(scene)
        self._placed: dict[str, NodeState] = {}
        draw = self._graph.mission.way if scene.coordinated else _draw_truth
        self._true_paths = {unit: GrowingPath(unit, draw) for unit in scene.units}
        self._believed_paths = {unit: GrowingPath(unit, _draw_belief) for unit in scene.units}
        self._plans: dict[str, AssemblyPath] = {}  # newest planned path of every unit
        self._framed: Array | None = None  # corners of the rectangle on the floor that is shown
        self._next_update = 0.0
        self._origin: tuple[float, int] | None = None
        self._cameras = None if drawer is None or scene.perception != "images" else LiveCameras(drawer)
        self._opened, self._browsers, self._lost = threading.Event(), 0, False
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(Path(server.__file__)), str(port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # Ctrl-C in a terminal reaches only this process, which then ends the server itself.
            start_new_session=True,
        )
        try:
            assert self._process.stdin is not None
            os.set_blocking(self._process.stdin.fileno(), False)
            self.url = self._await_url()
            page = render_page(scene, live_cameras=self._cameras is not None)
            self._send(server.PAGE, b"", page.encode())
            self._send_commands(self._graph.build())
        except BaseException:
            self.close()
            raise

    def _await_url(self) -> str:
        answered = threading.Event()
        lines: list[str] = []

        def read_output() -> None:
            assert self._process.stdout is not None
            with self._process.stdout as stdout:
                for line in stdout:
                    text = line.decode().strip()
                    if text == server.OPENED:
                        self._browsers += 1
                        self._opened.set()
                    elif text == server.CLOSED:
                        self._browsers -= 1
                    else:
                        lines.append(text)
                        answered.set()
            answered.set()

        threading.Thread(target=read_output, name="viewer", daemon=True).start()
        answered.wait(START_TIMEOUT)
        if not lines:
            raise ViewerError(f"the viewer's server did not start (exit code {self._process.poll()})")
        return lines[0]

    def wait_for_browser(self, timeout_s: float) -> bool:
        """Wait until a browser has opened the page, and return whether one has."""
        return self._opened.wait(timeout_s)

    def update(self, snapshot: Snapshot) -> None:
        """Show a snapshot. Those beyond :data:`MAX_RATE` only extend the drawn paths.

        If the server has ended or no longer reads, that is said once, and the trial goes on unseen.
        """
        if self._cameras is not None:
            self._cameras.add(snapshot)
        believed = {step.unit: step.estimate for step in snapshot.steps}
        for unit in self._true_paths:
            shown = unit in believed or snapshot.mission is not None
            self._true_paths[unit].add(snapshot.units[unit] if shown else None)
            self._believed_paths[unit].add(believed.get(unit) if snapshot.mission is None else None)
        self._keep_pace(snapshot.stamp_ns)
        now = time.monotonic()
        if now >= self._next_update:
            self._next_update = now + 1.0 / MAX_RATE
            with self._unless_lost():
                self._show(snapshot)

    def show(self, snapshot: Snapshot) -> None:
        """Show a snapshot regardless of :data:`MAX_RATE`, such as the last one of a trial."""
        self._next_update = 0.0
        self.update(snapshot)

    def wants(self, camera: str) -> bool:
        """Return whether an image of a camera would be shown now: a browser is there, and the last is old."""
        return self._cameras is not None and self._browsers > 0 and self._cameras.wants(camera)

    def show_view(self, view: CameraView) -> None:
        """Show what was read of a frame."""
        if self._cameras is not None:
            still = camera_data(view.exposure.camera, [self._cameras.draw(view)])
            key = f"still {view.exposure.camera}"
            with self._unless_lost():
                self._send(server.READING, key.encode(), json.dumps({"still": still}).encode())

    @contextmanager
    def _unless_lost(self) -> Iterator[None]:
        """Say once that the view is lost, so that the trial goes on."""
        try:
            yield
        except _LostError as error:
            if not self._lost:
                _log.warning("%s; the trial goes on without the view", error)
            self._lost = True

    def _keep_pace(self, stamp_ns: int) -> None:
        if self._pace is None:
            return
        now = time.monotonic()
        if self._origin is None:
            self._origin = now, stamp_ns
        started, first_ns = self._origin
        ahead = (stamp_ns - first_ns) / NS_PER_S / self._pace - (now - started)
        if ahead > 0.0:
            time.sleep(ahead)

    def _show(self, snapshot: Snapshot) -> None:
        commands: list[Command] = []
        commands += self._look_again(places([snapshot]))
        for node, state in self._graph.node_states(snapshot).items():
            commands += place(node, self._placed.get(node), state)
            self._placed[node] = state
        for step in snapshot.steps:
            unit, plan = step.unit, None if snapshot.mission is not None else step.path
            if plan is not None and plan is not self._plans.get(unit):
                commands += plan_commands(f"{LIVE_PLAN_NODE}_{unit}", plan.points)
                self._plans[unit] = plan
        commands += self._graph.mission.live_routes(snapshot)
        for path in (*self._true_paths.values(), *self._believed_paths.values()):
            commands += path.commands()
        self._send_commands(commands)
        message = {
            "time": seconds(snapshot.stamp_ns),
            "watched": "" if snapshot.watched is None else snapshot.watched.unit,
            "values": readings(snapshot, self._labels),
            "units": unit_readings(snapshot),
        }
        self._send(server.READING, b"readings", json.dumps(message).encode())

    def _look_again(self, points: Array) -> Iterator[Command]:
        """Yield the commands that show all bodies, from farther away if one has driven out of view.

        A reader who has moved the camera is not disturbed more often than that.
        """
        if self._framed is not None:
            middle, radius = framed(self._framed)
            out = points[np.hypot(*(points - middle).T) > _OUT_OF_VIEW * radius]
            if not len(out):
                return
            points = np.concatenate([self._framed, out - _BEYOND_M, out + _BEYOND_M])
        self._framed = np.stack([points.min(axis=0), points.max(axis=0)])
        yield from look_at(self._framed)

    def _send_commands(self, commands: Iterable[Command]) -> None:
        for command in commands:
            self._send(server.COMMAND, command.key.encode(), command.data)

    def _send(self, kind: bytes, key: bytes, data: bytes) -> None:
        stdin = self._process.stdin
        if stdin is None or stdin.closed:
            raise ViewerError("the viewer is closed")
        if self._lost:  # part of a message may be in the pipe
            return
        rest = memoryview(server.HEADER.pack(kind, len(key), len(data)) + key + data)
        while rest:
            # A server that hangs must not stop the trial: the pipe does not block, and the wait is limited.
            _, writable, _ = select.select([], [stdin], [], WRITE_TIMEOUT)
            if not writable:
                raise _LostError(f"the viewer's server has not read for {WRITE_TIMEOUT:g} s")
            try:
                rest = rest[os.write(stdin.fileno(), rest) :]
            except BlockingIOError:
                continue
            except BrokenPipeError:
                raise _LostError(
                    f"the viewer's server has ended (exit code {self._process.poll()})"
                ) from None

    def close(self) -> None:
        """End the server and wait until it has ended. A second call does nothing."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        for force in (self._process.terminate, self._process.kill):
            try:
                self._process.wait(CLOSE_TIMEOUT)
            except subprocess.TimeoutExpired:
                force()
        self._process.wait()

    def __enter__(self) -> LiveViewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _draw_truth(unit: str, piece: int, points: Sequence[Array]) -> Iterator[Command]:
    return path_commands(f"truth_{unit}_{piece}", points)


def _draw_belief(unit: str, piece: int, points: Sequence[Array]) -> Iterator[Command]:
    return path_commands(f"belief_{unit}_{piece}", points)
