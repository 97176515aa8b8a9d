"""The replay page and the live view, looked at in a real browser, and the life of the live view's server."""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from dataclasses import replace

import cv2
import numpy as np
import psutil
import pytest
import tornado.httpclient
import tornado.websocket
import umsgpack

from msrr_bullet.log import read_log
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.log_snapshots import snapshots
from msrr_bullet.viewer import live, page
from msrr_bullet.viewer.live import LiveViewer, ViewerError
from msrr_bullet.viewer.replay_page import write_replay
from msrr_bullet.viewer.shapes import strip
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None and not os.environ.get("MSRR_REQUIRE_CHROMIUM"),
    reason="no Chromium on this machine to open the page with",
)
SIZE = (1280, 800)
#: The stage of the page: beside the readings on the left, above the bar at the bottom.
STAGE = Window(270, 30, 1000, 680)


def screenshot(url, tmp_path, budget_ms=4000):
    """Return the page as an image (800, 1280, 3), RGB."""
    picture = tmp_path / "page.png"
    profile = tmp_path / "profile"
    options = [
        *("--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking"),
        *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-sandbox"),
        *("--hide-scrollbars", f"--window-size={SIZE[0]},{SIZE[1]}", f"--user-data-dir={profile}"),
        *(f"--virtual-time-budget={budget_ms}", f"--screenshot={picture}"),
    ]
    subprocess.run(
        [CHROMIUM, *options, url],
        check=True,
        timeout=120,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    return cv2.imread(str(picture))[:, :, ::-1]


def stage(image):
    return image[STAGE.y : STAGE.y_end, STAGE.x : STAGE.x_end].astype(int)


def pixels_of(image, colour):
    """Count the pixels of the stage that have exactly this colour, as drawings have it."""
    wanted = [(colour >> shift) & 255 for shift in (16, 8, 0)]
    return int((np.abs(stage(image) - wanted).max(axis=2) <= 2).sum())


def pixels_of_hue(image, colour):
    """Count the saturated pixels of the stage that have the hue of a colour, as lit bodies have it."""
    wanted = np.array([[[(colour >> shift) & 255 for shift in (16, 8, 0)]]], dtype=np.uint8)
    hue = int(cv2.cvtColor(wanted, cv2.COLOR_RGB2HSV)[0, 0, 0])
    hsv = cv2.cvtColor(stage(image).astype(np.uint8), cv2.COLOR_RGB2HSV).astype(int)
    return int(((np.abs(hsv[..., 0] - hue) <= 4) & (hsv[..., 1] > 90)).sum())


def tags_in(image):
    grey = np.ascontiguousarray(stage(image).astype(np.uint8).mean(axis=2).round().astype(np.uint8))
    return {tag.tag_id for tag in PupilDetector().detect(grey, Window(0, 0, grey.shape[1], grey.shape[0]))}


def assert_shows_the_trial(image, scene):
    assert pixels_of(image, palette.PATH) > 200, "driven path"
    assert pixels_of(image, palette.BELIEF) > 200, "believed path and ghost"
    assert pixels_of(image, palette.SIGHT) > 100, "camera and line of sight"
    assert pixels_of_hue(image, palette.DOCKING_UNIT) > 1000, "docking unit"
    # The tags are the right ones and the right way round: the detector reads them off the page.
    top = {scene.tag_ids(unit)["tag_top"] for unit in scene.units}
    assert top <= tags_in(image)


@needs_chromium
def test_replay_shows_units_marker_and_path_in_a_browser(drive, tmp_path):
    path = write_replay(tmp_path / "replay.html", drive.scene, drive.frames)
    image = screenshot(f"{path.as_uri()}#t=3.0", tmp_path)
    assert_shows_the_trial(image, drive.scene)
    assert pixels_of(image, palette.CLEARANCE) > 50


@needs_chromium
def test_replay_plays_by_itself(drive, tmp_path):
    # Half a second of trial: a headless browser's frames come slowly.
    path = write_replay(tmp_path / "replay.html", drive.scene, drive.frames[60:73])
    end = (drive.frames[72].stamp_ns - drive.frames[60].stamp_ns) / 1e9
    played = stage(screenshot(path.as_uri(), tmp_path, budget_ms=10_000))
    first, last = (stage(screenshot(f"{path.as_uri()}#t={t}", tmp_path)) for t in (0.0, end))
    moved = np.abs(played - first).max(axis=2) > 40
    assert moved.mean() > 0.01
    assert (np.abs(played - last).max(axis=2) > 40).mean() < 0.1 * moved.mean()


@needs_chromium
def test_live_page_shows_units_marker_and_path_in_a_browser(drive, tmp_path):
    with LiveViewer(drive.scene, port=0) as viewer:
        for frame in drive.frames[:120]:
            viewer.update(frame)
        viewer.show(drive.frames[119])
        image = screenshot(viewer.url, tmp_path, budget_ms=15_000)
        assert viewer.wait_for_browser(0.0)
    assert_shows_the_trial(image, drive.scene)


@needs_chromium
def test_the_command_shows_its_running_trial_in_a_browser(tmp_path):
    """``msrr dock --view`` waits for a browser, runs at the pace of real time, leaves no server behind."""
    command = [sys.executable, "-u", "-m", "msrr_bullet.cli", "dock", "close_range", "--view"]
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
        image = screenshot(url, tmp_path, budget_ms=15_000)
        said = program.stdout.read()
        assert program.wait(60) == 0, said
    finally:
        program.kill()
        program.wait()
        program.stdout.close()
    assert "docked" in said
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(url, timeout=5)
    assert_shows_the_trial(image, load_scene("close_range"))


@needs_chromium
@pytest.mark.parametrize("live_page", [False, True], ids=["replay", "live"])
def test_pages_show_the_plan_and_what_is_known_of_other_bodies(short_run, tmp_path, live_page):
    log = read_log(short_run)
    scene, frames = log.header.scene, snapshots(log)
    moment = next(f for f in frames if f.stamp_ns >= 3_000_000_000)
    assert moment.assembly is not None
    if live_page:
        with LiveViewer(scene, port=0) as viewer:
            viewer.show(moment)
            image = screenshot(viewer.url, tmp_path, budget_ms=8_000)
    else:
        image = screenshot(write_replay(tmp_path / "replay.html", scene, [moment]).as_uri(), tmp_path)
    assert pixels_of(image, palette.PLAN) > 50, "planned path and desired point"
    assert pixels_of(image, palette.BELIEF) > 150, "ghost, and the outlines of other bodies"


@needs_chromium
def test_a_trial_far_from_the_middle_of_the_world_is_in_view_too(drive, tmp_path):
    def moved(X):
        return SE2(X.x + 30.0, X.y - 20.0, X.yaw)

    frame = replace(drive.frames[100], clearance=None)
    far = replace(
        frame,
        units={name: moved(X) for name, X in frame.units.items()},
        obstacles={name: moved(X) for name, X in frame.obstacles.items()},
        estimate=moved(frame.estimate),
    )
    image = screenshot(write_replay(tmp_path / "far.html", drive.scene, [far]).as_uri(), tmp_path)
    assert {drive.scene.tag_ids(unit)["tag_top"] for unit in drive.scene.units} <= tags_in(image)


def test_readings_tell_the_path_and_no_angles_of_a_lost_target(short_run):
    log = read_log(short_run)
    frame = next(f for f in snapshots(log) if f.assembly is not None and f.stamp_ns >= 3_000_000_000)
    told = dict(zip(page.READINGS, page.readings(frame), strict=True))
    assert re.fullmatch(r"\d\.\d\d of \d\.\d\d m, \d+ mm off", told["on the path"])
    assert told["line of sight"] == "lost"
    assert told["phase"].startswith("assemble, ")


def test_replay_is_one_file_that_asks_the_network_for_nothing(drive, tmp_path):
    text = write_replay(tmp_path / "replay.html", drive.scene, drive.frames).read_text()
    ours = text.replace(page.viewer_script(), "")
    assert not re.search(r"""(src|href)\s*=|https?://|@import""", ours)


def test_the_same_trial_gives_the_same_replay(drive, tmp_path):
    first = write_replay(tmp_path / "a.html", drive.scene, drive.frames).read_bytes()
    assert first == write_replay(tmp_path / "b.html", drive.scene, iter(drive.frames)).read_bytes()


def test_a_description_cannot_end_the_script_that_holds_it(drive, tmp_path):
    nasty = drive.scene.model_copy(update={"description": "</script><script>alert(1)</script>"})
    text = write_replay(tmp_path / "replay.html", nasty, drive.frames[:3]).read_text()
    assert "alert(1)</script>" not in text
    data = re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert json.loads(data[1])["description"] == nasty.description


def test_replay_of_one_bare_frame_and_of_none(drive, tmp_path):
    bare = replace(drive.frames[0], step=None, estimate=None, phase=None, los=None, clearance=None)
    assert write_replay(tmp_path / "one.html", drive.scene, [bare]).is_file()
    with pytest.raises(MsrrError, match="without a single frame"):
        write_replay(tmp_path / "none.html", drive.scene, [])


def test_strip_is_a_band_of_its_width():
    geometry = strip([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 2.0]], 0.1, 0.02)
    a, b, c = (geometry.vertices[geometry.faces[:, i]].astype(float) for i in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert areas.sum() == pytest.approx(0.1 * (1.1 + 2.1), rel=1e-6)
    assert np.isfinite(geometry.vertices).all()


def server_of(viewer):
    return psutil.Process(viewer._process.pid)


def test_nothing_listens_off_loopback(drive):
    with LiveViewer(drive.scene, port=0) as viewer:
        viewer.update(drive.frames[0])
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


def test_a_browser_that_comes_late_gets_the_whole_scene(drive):
    async def first_messages(url):
        connection = await tornado.websocket.websocket_connect(url)
        messages = []
        while not (messages and isinstance(messages[-1], str)):
            messages.append(await asyncio.wait_for(connection.read_message(), 10))
        connection.close()
        return messages

    with LiveViewer(drive.scene, port=0) as viewer:
        for frame in drive.frames:
            viewer.update(frame)
        viewer.show(drive.frames[-1])
        *commands, last = asyncio.run(first_messages(viewer.url.replace("http:", "ws:") + "feed"))
    state = [umsgpack.unpackb(command) for command in commands]
    objects = {m["path"] for m in state if m["type"] == "set_object"}
    assert {f"units/{unit}/tag_top" for unit in drive.scene.units} <= objects
    assert {"path/truth_0", "path/belief_0"} <= objects
    final = [m for m in state if m["type"] == "set_transform" and m["path"] == "units/a"]
    assert len(final) == 1, "only the latest of each change is kept"
    assert final[0]["matrix"][12] == pytest.approx(drive.frames[-1].units["a"].x)
    assert json.loads(last)[1] == "done"


def test_pace_holds_the_trial_back(drive):
    with LiveViewer(drive.scene, port=0, pace=8.0) as viewer:
        start = time.monotonic()
        for frame in drive.frames[:101]:
            viewer.update(frame)
        simulated = (drive.frames[100].stamp_ns - drive.frames[0].stamp_ns) / 1e9
        assert time.monotonic() - start >= simulated / 8.0 - 1e-3


def test_a_taken_port_is_no_obstacle(drive):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with LiveViewer(drive.scene, port=port) as viewer:
            assert f":{port}/" not in viewer.url


def show_for_ever(viewer, frames):
    while True:
        for frame in frames:
            viewer.show(frame)


def test_a_server_that_hangs_is_an_error_not_a_hang(drive, monkeypatch):
    monkeypatch.setattr(live, "WRITE_TIMEOUT", 0.3)
    monkeypatch.setattr(live, "CLOSE_TIMEOUT", 0.3)
    viewer = LiveViewer(drive.scene, port=0)
    process = server_of(viewer)
    process.suspend()
    with pytest.raises(ViewerError, match="has not read"):
        show_for_ever(viewer, drive.frames)
    viewer.close()
    assert not process.is_running()


def test_a_server_that_dies_is_an_error(drive):
    viewer = LiveViewer(drive.scene, port=0)
    server_of(viewer).kill()
    with pytest.raises(ViewerError, match="has ended"):
        show_for_ever(viewer, drive.frames)
    viewer.close()
    viewer.close()
    with pytest.raises(ViewerError, match="closed"):
        viewer.show(drive.frames[0])


OWNER = """
import os, sys, time
from msrr_bullet.viewer.live import LiveViewer
from msrr_scenes.loading.load import load_scene
how = sys.argv[1]
viewer = LiveViewer(load_scene("close_range"), port=0)
child = 0
if how == "forked":
    child = os.fork()
    if child == 0:  # holds copies of all pipes, and outlives its parent
        time.sleep(30)
        os._exit(0)
print(viewer._process.pid, child, flush=True)
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


def end_owner(owner, end):
    """End an owner; return the seconds that its server outlived it."""
    server, child = (int(pid) for pid in owner.stdout.readline().split())
    try:
        if end is not None:
            assert not gone(server)
            owner.send_signal(end)
        owner.wait(30)
        ended = time.monotonic()
        while not gone(server) and time.monotonic() < ended + 15.0:
            time.sleep(0.02)
        return time.monotonic() - ended
    finally:
        if child:
            os.kill(child, signal.SIGKILL)


def test_no_server_outlives_its_owner_whatever_ends_it(tmp_path):
    script = tmp_path / "owner.py"
    script.write_text(OWNER)
    owners = {}
    try:
        for how in ENDS:  # all at once: what takes long is to import
            owners[how] = subprocess.Popen(
                [sys.executable, str(script), how],
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                # A shell's background jobs are deaf to Ctrl-C, and so are these tests when they run in one.
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            )
        outlived = {how: end_owner(owner, ENDS[how]) for how, owner in owners.items()}
    finally:
        for owner in owners.values():
            owner.kill()
            owner.wait()
            owner.stdout.close()
    assert max(outlived.values()) < 10.0, outlived
