"""The running trial in a browser, served on loopback by a process that cannot outlive this one."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType

import numpy as np

from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.viewer import server
from msrr_bullet.viewer.arena_belief import PLAN_NOW, plan_commands
from msrr_bullet.viewer.commands import Command, set_property, set_transform
from msrr_bullet.viewer.nodes import Placement
from msrr_bullet.viewer.page import readings, render_page
from msrr_bullet.viewer.scene_graph import PATH_STEP, SceneGraph, look_at
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, AssemblyPath
from msrr_scenes.specs.scene import Scene

DEFAULT_PORT = 7000
#: Instants shown per second of wall-clock time, at most.
FRAME_RATE = 30.0
#: How long the server may take to start, to read on, and to go [s].
START_TIMEOUT, WRITE_TIMEOUT, CLOSE_TIMEOUT = 20.0, 5.0, 2.0
#: Points of a path that are drawn as one band, so that a long path costs no more per frame than a short one.
BAND_POINTS = 100


class ViewerError(MsrrError):
    """The live view could not start or has broken off."""


class LiveViewer:
    """Shows a trial in the browser while it runs. Use it in a ``with`` block.

    The server is a process of its own whose life hangs on a pipe from this one: it ends when the viewer is
    closed, and also when this process ends in any other way.
    """

    def __init__(self, scene: Scene, port: int = DEFAULT_PORT, pace: float | None = None) -> None:
        """Start the server; :attr:`url` says where.

        Args:
            scene: The scene of the trial.
            port: Port on 127.0.0.1; any free one when it is taken.
            pace: Simulated seconds per second at most, so that one can follow; None holds nothing up.

        Raises:
            ViewerError: The server did not start.
        """
        self._graph = SceneGraph(scene)
        self._pace = pace
        self._placed: dict[str, Placement] = {}
        self._bands = {name: _Band(self._graph, name) for name in ("truth", "belief")}
        self._path: AssemblyPath | None = None
        self._view_set = False
        self._next_frame = 0.0
        self._origin: tuple[float, int] | None = None
        self._opened = threading.Event()
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(Path(server.__file__)), "--port", str(port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C in a terminal is ours to handle, in our order
        )
        try:
            assert self._process.stdin is not None
            os.set_blocking(self._process.stdin.fileno(), False)
            self.url = self._await_url()
            self._send(server.PAGE, b"", render_page(scene).encode())
            self._send_commands(self._graph.build())
        except BaseException:
            self.close()
            raise

    def _await_url(self) -> str:
        told = threading.Event()
        lines: list[str] = []

        def listen() -> None:
            assert self._process.stdout is not None
            with self._process.stdout as stdout:
                for line in stdout:
                    text = line.decode().strip()
                    if text == server.OPENED:
                        self._opened.set()
                    else:
                        lines.append(text)
                        told.set()
            told.set()

        threading.Thread(target=listen, name="viewer", daemon=True).start()
        told.wait(START_TIMEOUT)
        if not lines:
            raise ViewerError(f"the viewer's server did not start (exit code {self._process.poll()})")
        return lines[0]

    def wait_for_browser(self, timeout_s: float) -> bool:
        """Wait until a browser has opened the page; say whether one has."""
        return self._opened.wait(timeout_s)

    def update(self, snapshot: Snapshot) -> None:
        """Show an instant; the ones that come too quickly for an eye only leave their mark on the paths.

        Raises:
            ViewerError: The server is gone or does not read any more.
        """
        truth, belief = _acting_poses(snapshot)
        self._bands["truth"].add(truth)
        self._bands["belief"].add(belief)
        self._keep_pace(snapshot.stamp_ns)
        now = time.monotonic()
        if now >= self._next_frame:
            self._next_frame = now + 1.0 / FRAME_RATE
            self._show(snapshot)

    def show(self, snapshot: Snapshot) -> None:
        """Show an instant whatever the frame rate, such as the last one of a trial."""
        self._next_frame = 0.0
        self.update(snapshot)

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
        if not self._view_set:
            poses = [*snapshot.units.values(), *snapshot.obstacles.values()]
            commands += look_at(np.array([[X.x, X.y] for X in poses]))
            self._view_set = True
        for node, placement in self._graph.placements(snapshot).items():
            commands += _changes(node, self._placed.get(node), placement)
            self._placed[node] = placement
        if snapshot.path is not None and snapshot.path is not self._path:
            commands += plan_commands(PLAN_NOW, snapshot.path.points)
            self._path = snapshot.path
        for band in self._bands.values():
            commands += band.commands()
        self._send_commands(commands)
        self._send(server.READING, b"readings", json.dumps(readings(snapshot)).encode())

    def _send_commands(self, commands: Iterable[Command]) -> None:
        for command in commands:
            self._send(server.COMMAND, command.key.encode(), command.data)

    def _send(self, kind: bytes, key: bytes, data: bytes) -> None:
        stdin = self._process.stdin
        if stdin is None or stdin.closed:
            raise ViewerError("the viewer is closed")
        left = memoryview(server.HEADER.pack(kind, len(key), len(data)) + key + data)
        while left:
            # A server that hangs must not hang the trial: the pipe does not block, and patience is limited.
            _, writable, _ = select.select([], [stdin], [], WRITE_TIMEOUT)
            if not writable:
                raise ViewerError(f"the viewer's server has not read for {WRITE_TIMEOUT:g} s")
            try:
                left = left[os.write(stdin.fileno(), left) :]
            except BlockingIOError:
                continue
            except BrokenPipeError:
                raise ViewerError(
                    f"the viewer's server has ended (exit code {self._process.poll()})"
                ) from None

    def close(self) -> None:
        """End the server and wait until it is gone; calling it twice is fine."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        for insist in (self._process.terminate, self._process.kill):
            try:
                self._process.wait(CLOSE_TIMEOUT)
            except subprocess.TimeoutExpired:
                insist()
        self._process.wait()

    def __enter__(self) -> LiveViewer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _Band:
    """A path that grows: full bands stay as they are, the last one is drawn again when it gets longer."""

    def __init__(self, graph: SceneGraph, name: str) -> None:
        self._graph = graph
        self._name = name
        self._index = 0
        self._points: list[Array] = []
        self._waiting: list[Command] = []
        self._grown = False

    def add(self, X: SE2 | None) -> None:
        if X is None:
            if self._points:
                self._finish([])
            return
        if self._points and np.linalg.norm(X.translation - self._points[-1]) < PATH_STEP:
            return
        self._points.append(X.translation)
        self._grown = True
        if len(self._points) >= BAND_POINTS:
            self._finish(self._points[-1:])

    def _finish(self, start: list[Array]) -> None:
        self._waiting += self._draw()
        self._index += 1
        self._points = start

    def _draw(self) -> Iterator[Command]:
        self._grown = False
        return self._graph.path_commands(f"{self._name}_{self._index}", tuple(self._points))

    def commands(self) -> list[Command]:
        commands, self._waiting = self._waiting, []
        return commands + list(self._draw()) if self._grown else commands


def _acting_poses(snapshot: Snapshot) -> tuple[SE2 | None, SE2 | None]:
    if snapshot.step is None:
        return None, None
    return snapshot.units.get(snapshot.step.unit), snapshot.estimate


def _changes(node: str, old: Placement | None, new: Placement) -> Iterator[Command]:
    if old is None or old.visible != new.visible:
        yield set_property(node, "visible", new.visible)
    moved = old is None or not (
        np.array_equal(old.X.p, new.X.p) and np.array_equal(old.X.R, new.X.R) and old.scale == new.scale
    )
    if moved and new.visible:
        yield set_transform(node, new.X, new.scale)
