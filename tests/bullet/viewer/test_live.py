"""Live view of a trial in a browser, and the life of its server."""

from __future__ import annotations

import asyncio
import base64
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import cv2
import numpy as np
import psutil
import pytest
import tornado.httpclient
import tornado.websocket
import umsgpack

from msrr_bullet.figures.frames.stills import live_stills
from msrr_bullet.timeline.camera_views import read_camera_views, read_exposures
from msrr_bullet.viewer import live, live_cameras
from msrr_bullet.viewer.live import LiveViewer, ViewerError
from msrr_scenes.loading.load import load_scene


def test_it_shows_units_tags_and_paths(browser, drive):
    with LiveViewer(drive.scene, port=0) as viewer:
        for snapshot in drive.snapshots[:120]:
            viewer.update(snapshot)
        viewer.show(drive.snapshots[119])
        image = browser.screenshot(viewer.url, until="latest")
        assert viewer.wait_for_browser(0.0)
    browser.assert_shows_the_trial(image, drive.scene)


@pytest.fixture(scope="module")
def views(short_log):
    """The last view of each camera."""
    last = {exposure.camera: exposure for exposure in read_exposures(short_log)}
    return list(read_camera_views(short_log, last.values()))


@pytest.fixture
def with_cameras(short_log, short_snapshots):
    """A live view of a whole run but for the images of its cameras."""
    scene = short_log.header.scene
    with LiveViewer(scene, port=0, drawer=live_stills(scene, short_log.header.seed)) as viewer:
        for snapshot in short_snapshots:
            viewer.update(snapshot)
        viewer.show(short_snapshots[-1])
        yield viewer


def test_images_are_drawn_for_a_browser_alone_and_not_too_often(with_cameras, views):
    async def images(url):
        connection = await tornado.websocket.websocket_connect(url)
        assert with_cameras.wait_for_browser(5.0)
        shown = {}
        for view in views:
            assert with_cameras.wants(view.exposure.camera)
            start = time.monotonic()
            with_cameras.show_view(view)
            assert not with_cameras.wants(view.exposure.camera)
            while not with_cameras.wants(view.exposure.camera):
                await asyncio.sleep(0.01)
            assert time.monotonic() - start >= 1.0 / live_cameras.MAX_RATE
        while len(shown) < len(views):
            message = await asyncio.wait_for(connection.read_message(), 10)
            if isinstance(message, str) and "still" in (told := json.loads(message)):
                shown[told["still"]["name"]] = told["still"]
        connection.close()
        return shown

    assert not any(with_cameras.wants(view.exposure.camera) for view in views)
    shown = asyncio.run(images(with_cameras.url.replace("http:", "ws:") + "feed"))
    assert set(shown) == {"overhead", "a/onboard"}
    for view in views:
        still = shown[view.exposure.camera]
        assert still["times"] == [view.stamp_ns / 1e9]
        file = np.frombuffer(base64.b64decode(still["images"][0]), dtype=np.uint8)
        assert cv2.imdecode(file, cv2.IMREAD_COLOR).shape == (480, 640, 3)
    wait_until(lambda: not with_cameras.wants("overhead"), 5.0)
    assert not with_cameras.wants("overhead"), "the browser has left"


def test_the_page_shows_the_newest_images_beside_the_scene(browser, with_cameras, views):
    browser.open(with_cameras.url, until="latest")
    assert browser.evaluate("$('cameras').textContent").count("not looking yet") == 2
    assert with_cameras.wait_for_browser(5.0)
    for view in views:
        with_cameras.show_view(view)
    browser.wait("[...document.querySelectorAll('#cameras img')].every((i) => i.naturalWidth === 640)")
    text = browser.evaluate("$('cameras').textContent")
    for view in views:
        assert f"{view.exposure.camera}{view.stamp_ns / 1e9:.2f} s" in text
    assert "tags found" in text
    shown = browser.evaluate("[pane, ...document.querySelectorAll('img')].map((e) => e.clientWidth)")
    assert min(shown) > 100
    assert browser.console == []


@pytest.mark.nightly
def test_the_command_shows_its_running_trial_in_a_browser(browser, tmp_path):
    """``msrr dock --view`` waits for a browser, runs at the pace of real time, leaves no server behind."""
    command = [sys.executable, "-u", "-m", "msrr_bullet", "dock", "close_range", "--view"]
    program = subprocess.Popen(
        [*command, "--out", str(tmp_path / "run")],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "BROWSER": "true"},  # a browser of the desktop's has no place in a test
    )
    try:
        url = next(found[0] for line in program.stdout if (found := re.findall(r"http://\S+", line)))

        async def watch(seconds):
            connection = await tornado.websocket.websocket_connect(url.replace("http:", "ws:") + "feed")
            await asyncio.sleep(seconds)
            connection.close()

        asyncio.run(watch(5.0))
        image = browser.screenshot(url, until="latest && latest.values[1] === 'dock'")
        output = program.stdout.read()
        assert program.wait(60) == 0, output
    finally:
        program.kill()
        program.wait()
        program.stdout.close()
    assert "docked" in output
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(url, timeout=5)
    browser.assert_shows_the_trial(image, load_scene("close_range"))


def server_of(viewer):
    return psutil.Process(viewer._process.pid)


def test_nothing_listens_off_loopback(drive):
    with LiveViewer(drive.scene, port=0) as viewer:
        viewer.update(drive.snapshots[0])
        mine, theirs = psutil.Process(), server_of(viewer)
        sockets = [c for p in (mine, theirs, *theirs.children()) for c in p.net_connections("all")]
        listening = [c.laddr.ip for c in sockets if c.status == psutil.CONN_LISTEN]
        assert listening == ["127.0.0.1"]
        assert viewer.url.startswith("http://127.0.0.1:")


def test_pages_from_elsewhere_are_refused(drive):
    with LiveViewer(drive.scene, port=0) as viewer:
        foreign_name = urllib.request.Request(viewer.url, headers={"Host": "evil.example"})
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(foreign_name, timeout=10)
        with urllib.request.urlopen(viewer.url, timeout=10) as answer:
            assert b"MeshCat" in answer.read()

        async def connect_from(origin):
            url = viewer.url.replace("http:", "ws:") + "feed"
            request = tornado.httpclient.HTTPRequest(url, headers={"Origin": origin})
            (await tornado.websocket.websocket_connect(request)).close()

        with pytest.raises(tornado.httpclient.HTTPClientError, match="403"):
            asyncio.run(connect_from("http://evil.example"))
        asyncio.run(connect_from(viewer.url.rstrip("/")))


def test_a_browser_that_connects_late_gets_the_whole_scene(drive):
    async def first_messages(url):
        connection = await tornado.websocket.websocket_connect(url)
        messages = []
        while not (messages and isinstance(messages[-1], str)):
            messages.append(await asyncio.wait_for(connection.read_message(), 10))
        connection.close()
        return messages

    with LiveViewer(drive.scene, port=0) as viewer:
        for snapshot in drive.snapshots:
            viewer.update(snapshot)
        viewer.show(drive.snapshots[-1])
        phase = ""
        while phase != "done":  # the server may still be reading the snapshots before the last one
            *commands, last = asyncio.run(first_messages(viewer.url.replace("http:", "ws:") + "feed"))
            phase = json.loads(last)["values"][1]
    state = [umsgpack.unpackb(command) for command in commands]
    objects = {m["path"] for m in state if m["type"] == "set_object"}
    assert {f"units/{unit}/tag_top" for unit in drive.scene.units} <= objects
    assert {"path/truth_a_0", "path/belief_a_0"} <= objects
    final = [m for m in state if m["type"] == "set_transform" and m["path"] == "units/a"]
    assert len(final) == 1, "only the latest of each change is kept"
    assert final[0]["matrix"][12] == pytest.approx(drive.snapshots[-1].units["a"].x)


def test_what_a_client_says_is_dropped(drive, capfd):
    async def say(url):
        connection = await tornado.websocket.websocket_connect(url)
        await connection.write_message("hello")
        await connection.write_message(b"\x00", binary=True)
        assert await connection.read_message() is not None
        connection.close()

    with LiveViewer(drive.scene, port=0) as viewer:
        viewer.show(drive.snapshots[0])
        asyncio.run(asyncio.wait_for(say(viewer.url.replace("http:", "ws:") + "feed"), 30.0))
    assert capfd.readouterr().err == ""


def test_pace_holds_the_trial_back(drive):
    with LiveViewer(drive.scene, port=0, pace=8.0) as viewer:
        start = time.monotonic()
        for snapshot in drive.snapshots[:101]:
            viewer.update(snapshot)
        simulated = (drive.snapshots[100].stamp_ns - drive.snapshots[0].stamp_ns) / 1e9
        assert time.monotonic() - start >= simulated / 8.0 - 1e-3


def test_a_taken_port_is_replaced_by_a_free_one(drive):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with LiveViewer(drive.scene, port=port) as viewer:
            assert f":{port}/" not in viewer.url


def show_until(text, viewer, snapshots, caplog):
    """Show snapshots until a warning has come, and then some more."""
    while not caplog.records:
        for snapshot in snapshots:
            viewer.show(snapshot)
    viewer.show(snapshots[0])
    (warning,) = caplog.records
    assert text in warning.getMessage()
    assert "goes on without the view" in warning.getMessage()


def test_a_server_that_hangs_costs_the_view_and_not_the_trial(drive, monkeypatch, caplog):
    monkeypatch.setattr(live, "WRITE_TIMEOUT", 0.3)
    monkeypatch.setattr(live, "CLOSE_TIMEOUT", 0.3)
    viewer = LiveViewer(drive.scene, port=0)
    process = server_of(viewer)
    process.suspend()
    show_until("has not read", viewer, drive.snapshots, caplog)
    viewer.close()
    assert not process.is_running()


def test_a_server_that_ends_costs_the_view_and_not_the_trial(drive, caplog):
    viewer = LiveViewer(drive.scene, port=0)
    server_of(viewer).kill()
    show_until("has ended", viewer, drive.snapshots, caplog)
    viewer.close()
    viewer.close()
    with pytest.raises(ViewerError, match="closed"):
        viewer.show(drive.snapshots[0])


OWNER = """
import os, sys, time
from msrr_bullet.viewer.live import LiveViewer
from msrr_scenes.loading.load import load_scene
# What takes long is to import; each owner is a process that begins with the imports done.
for how in sys.argv[1:]:
    if os.fork() == 0:
        break
else:
    while True:
        try:
            os.wait()
        except ChildProcessError:
            sys.exit()
viewer = LiveViewer(load_scene("close_range"), port=0)
if how == "forked" and os.fork() == 0:  # holds copies of all pipes, and outlives its parent
    time.sleep(30)
    os._exit(0)
print(how, os.getpid(), viewer._process.pid, sep=",", flush=True)
if how == "closed":
    viewer.close()
elif how == "exception":
    raise RuntimeError("on purpose")
elif how == "hard exit":
    os._exit(3)
elif how == "with block":
    with viewer:
        raise KeyboardInterrupt
elif how != "returned":
    time.sleep(60)
"""

#: How the owner of a viewer ends: by itself (None) or by a signal.
ENDS = {
    "returned": None,
    "closed": None,
    "exception": None,
    "hard exit": None,
    "with block": None,
    "Ctrl-C": signal.SIGINT,
    "terminated": signal.SIGTERM,
    "killed": signal.SIGKILL,
    "forked": signal.SIGKILL,
}


def gone(pid):
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def end_owner(owner, server, end):
    """End an owner; return the seconds that its server outlived it."""
    if end is not None:
        assert not gone(server)
        os.kill(owner, end)
    wait_until(lambda: gone(owner), 30.0)
    assert gone(owner)
    return wait_until(lambda: gone(server), 15.0)


def wait_until(true, limit_s):
    """Wait until a condition is true, and return how long that took; give up after a time."""
    start = time.monotonic()
    while not true() and time.monotonic() < start + limit_s:
        time.sleep(0.02)
    return time.monotonic() - start


@pytest.mark.nightly
def test_no_server_outlives_its_owner_whatever_ends_it(tmp_path):
    script = tmp_path / "owner.py"
    script.write_text(OWNER)
    program = subprocess.Popen(
        [sys.executable, str(script), *ENDS],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
        # A shell's background jobs are deaf to Ctrl-C, and so are these tests when they run in one.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    outlived = {}
    try:
        for _ in ENDS:
            how, owner, server = program.stdout.readline().strip().split(",")
            outlived[how] = end_owner(int(owner), int(server), ENDS[how])
    finally:
        os.killpg(program.pid, signal.SIGKILL)
        program.wait()
        program.stdout.close()
    assert outlived.keys() == ENDS.keys()
    assert max(outlived.values()) < 10.0, outlived
