"""A browser that opens pages, what its pictures show, and how a reader uses a page."""

from __future__ import annotations

import asyncio
import base64
import json
import os
import shutil
import subprocess
import time

import cv2
import numpy as np
import pytest
import tornado.websocket

from msrr_bullet.timeline import palette
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.geometry.pinhole import Window

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SIZE = (1680, 900)
#: The part of the page that shows the scene: left, top, right, bottom [px].
STAGE = """(() => {
  const {left, top, right, bottom} = pane.getBoundingClientRect();
  return [left, top, right, bottom].map(Math.round);
})()"""
#: Until the next two frames are drawn.
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))"
#: Keys whose events need a code of the key, and the texts that they enter.
KEY_CODES = {"Tab": (9, ""), "Enter": (13, "\r"), " ": (32, " ")}


class Browser:
    """Chromium without a window, led over the DevTools protocol, and what its pictures of a page show.

    Attributes:
        console: What the open page wrote to its console, and its errors.
        requests: Addresses that the open page has requested, without data in the page itself.
    """

    def __init__(self, profile):
        options = [
            *("--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking"),
            *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-sandbox"),
            *("--hide-scrollbars", "--remote-debugging-port=0", f"--user-data-dir={profile}"),
        ]
        self._process = subprocess.Popen(
            [CHROMIUM, *options, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        url = next(line.split()[-1] for line in self._process.stderr if "listening on ws:" in line)
        self._loop, self._number, self._page = asyncio.new_event_loop(), 0, None
        self._socket = self._loop.run_until_complete(self._connect(url))
        self.console, self.requests = [], []

    async def _connect(self, url):
        return await tornado.websocket.websocket_connect(url, max_message_size=2**28)

    async def _disconnect(self):
        self._socket.close()

    def close(self):
        self._loop.run_until_complete(self._disconnect())
        self._process.terminate()
        self._process.wait()
        self._process.stderr.close()
        self._loop.close()

    def call(self, method, **parameters):
        """Call a method of the protocol for the open page, and return its result."""
        return self._loop.run_until_complete(asyncio.wait_for(self._call(method, parameters), 120.0))

    async def _call(self, method, parameters):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._page is not None:
            message["sessionId"] = self._page
        await self._socket.write_message(json.dumps(message))
        while True:
            answer = json.loads(await self._socket.read_message())
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]
            self._note(answer.get("method"), answer.get("params"))

    def _note(self, event, said):
        if event in ("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"):
            self.console.append(json.dumps(said)[:500])
        elif event == "Network.requestWillBeSent" and not said["request"]["url"].startswith("data:"):
            self.requests.append(said["request"]["url"])
        elif event == "Network.webSocketCreated":
            self.requests.append(said["url"])

    def open(self, url, size=SIZE, dark=False, until="true"):
        """Open a page in place of the one before, and wait until a condition in JavaScript holds."""
        old, self._page = self._page, None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        if old is not None:
            self.call("Target.closeTarget", targetId=self._target)
        self._page, self._target = session, target
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")
        self.console, self.requests = [], []
        self.resize(size)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.bringToFront")  # a page in the background draws nothing
        self.call("Page.navigate", url=url)
        self.wait(f"document.readyState === 'complete' && location.href !== 'about:blank' && ({until})")

    def leave(self):
        """Leave the open page, which would go on drawing."""
        if self._page is not None:
            self.call("Page.navigate", url="about:blank")

    def resize(self, size):
        metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **metrics)

    def evaluate(self, expression):
        """Return the value of an expression, or of the promise that it gives."""
        done = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in done, done
        return done["result"].get("value")

    def wait(self, condition, limit_s=120.0):
        """Wait until a condition in JavaScript holds."""
        end = time.monotonic() + limit_s
        while not self.evaluate(condition):
            assert time.monotonic() < end, f"never: {condition}"
            time.sleep(0.02)

    def press(self, key, shift=False):
        """Press a key."""
        code, text = KEY_CODES.get(key, (0, key if len(key) == 1 else ""))
        event = {"key": key, "windowsVirtualKeyCode": code, "modifiers": 8 if shift else 0}
        self.call("Input.dispatchKeyEvent", type="keyDown", **event, **({"text": text} if text else {}))
        self.call("Input.dispatchKeyEvent", type="keyUp", **event)

    def click(self, element, share=(0.5, 0.5)):
        """Click on an element, given by an expression, at a share of its width and height."""
        box = "(e => { e.scrollIntoView({block: 'center'}); return e.getBoundingClientRect().toJSON() })"
        at = self.evaluate(f"{box}({element})")
        place = {"x": at["x"] + share[0] * at["width"], "y": at["y"] + share[1] * at["height"]}
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, button="left", buttons=1, clickCount=1, **place)

    def picture(self):
        """Return the open page as an image (height, width, 3), RGB."""
        self.evaluate(DRAWN)
        png = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        left, top, right, bottom = self.evaluate(STAGE)
        self._stage = np.s_[max(0, top) : max(0, bottom), left:right]
        return cv2.imdecode(np.frombuffer(png, dtype=np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]

    def screenshot(self, url, until="true"):
        """Open a page, and return it as an image (900, 1680, 3), RGB."""
        self.open(url, until=until)
        return self.picture()

    def stage(self, image):
        return image[self._stage].astype(int)

    def pixels_of(self, image, colour):
        """Count the pixels of the stage that have exactly this colour, as drawings have it."""
        wanted = [(colour >> shift) & 255 for shift in (16, 8, 0)]
        return int((np.abs(self.stage(image) - wanted).max(axis=2) <= 2).sum())

    def pixels_of_hue(self, image, colour):
        """Count the saturated pixels of the stage that have the hue of a colour, as lit bodies have it."""
        wanted = np.array([[[(colour >> shift) & 255 for shift in (16, 8, 0)]]], dtype=np.uint8)
        hue = int(cv2.cvtColor(wanted, cv2.COLOR_RGB2HSV)[0, 0, 0])
        hsv = cv2.cvtColor(self.stage(image).astype(np.uint8), cv2.COLOR_RGB2HSV).astype(int)
        return int(((np.abs(hsv[..., 0] - hue) <= 4) & (hsv[..., 1] > 90)).sum())

    def tags_in(self, image):
        grey = np.ascontiguousarray(self.stage(image).astype(np.uint8).mean(axis=2).round().astype(np.uint8))
        return {
            tag.tag_id for tag in PupilDetector().detect(grey, Window(0, 0, grey.shape[1], grey.shape[0]))
        }

    def assert_shows_the_trial(self, image, scene):
        assert self.pixels_of(image, palette.PATH) > 200, "driven path"
        assert self.pixels_of(image, palette.BELIEF) > 200, "believed path and ghost"
        assert self.pixels_of(image, palette.SIGHT) > 100, "camera and line of sight"
        assert self.pixels_of_hue(image, palette.DOCKING_UNIT) > 1000, "docking unit"
        # The tags are the right ones and the right way round: the detector reads them off the page.
        top = {scene.tag_ids(unit)["tag_top"] for unit in scene.units}
        assert top <= self.tags_in(image)


@pytest.fixture(scope="session")
def chromium(tmp_path_factory):
    """Chromium without a window. Tests that use it are skipped where there is none."""
    if CHROMIUM is None and not os.environ.get("MSRR_REQUIRE_CHROMIUM"):
        pytest.skip("no Chromium on this machine")  # pip cannot install it; in CI a missing one fails
    started = Browser(tmp_path_factory.mktemp("chromium"))
    yield started
    started.close()


@pytest.fixture
def browser(chromium):
    """Chromium; the page that a test opened is left when the test ends, for a replay takes a core to draw."""
    yield chromium
    chromium.leave()
