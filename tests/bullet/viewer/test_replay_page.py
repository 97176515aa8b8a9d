"""Page of a finished run, used in a browser as its reader uses it, and read as text."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from msrr_bullet.figures.frames import stills as stills_module
from msrr_bullet.figures.frames.stills import draw_stills
from msrr_bullet.log.records import Event, Level
from msrr_bullet.timeline import palette
from msrr_bullet.timeline.interpolation import SnapshotInterpolator
from msrr_bullet.timeline.log_snapshots import read_events
from msrr_bullet.timeline.snapshot_builder import target_frame
from msrr_bullet.viewer import page
from msrr_bullet.viewer.replay_page import write_replay
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from tests.bullet.conftest import with_step

#: Time of the page, and what stands in the parts that show it.
SHOWN = """(() => {
  const images = [...document.querySelectorAll("#cameras figure:not([hidden]) img")];
  const {x, y} = viewer.scene_tree.find(["units", "a"]).object.position;
  const lines = [...document.querySelectorAll(".now")].map((line) => line.getBoundingClientRect().left);
  return {time: clock.time, playing: clock.playing, a: [x, y], lines,
    images: images.map((image) => ({at: image.dataset.time, file: image.src, ready: image.naturalWidth})),
    slider: Number($("time").value), clock: $("clock").textContent, reading: cells[0].textContent};
})()"""
#: Let the page stall for a second, and say how far it has played two frames later.
STALL = """new Promise((resolve) => {
  const before = clock.time, end = performance.now() + 1000;
  while (performance.now() < end);
  requestAnimationFrame(() => requestAnimationFrame(() => resolve(clock.time - before)));
})"""
#: Largest distance of a body in the page from its true pose; the page interpolates on straight lines [m].
NEAR = 0.001


@pytest.fixture(scope="module")
def stills(short_log, short_snapshots):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stills_module, "MAX_STILLS", 16)  # enough to step between, and quick
        return draw_stills(short_log, short_snapshots)


@pytest.fixture(scope="module")
def run_page(short_log, short_snapshots, stills, tmp_path_factory):
    """The page of a run that both cameras saw, with an event from the middle that was no good."""
    path = tmp_path_factory.mktemp("page") / "replay.html"
    middle = Event(short_snapshots[len(short_snapshots) // 2].stamp_ns, "a", "on purpose", Level.WARNING)
    events = sorted([*read_events(short_log), middle], key=lambda event: event.stamp_ns)
    return write_replay(path, short_log.header.scene, short_snapshots, stills, events)


def assert_one_instant(shown, snapshots, stills):
    """All parts of the page show its time: the bodies stand so, and an image is of the time that it says."""
    time = shown["time"]
    assert abs(shown["slider"] - time) < 1e-6
    assert shown["clock"].startswith(f"{time:.2f} /")
    assert 0.0 <= time - float(shown["reading"].split()[0]) < 0.06  # the last decision
    start_ns = snapshots[0].stamp_ns
    true = SnapshotInterpolator(snapshots).at(start_ns + round(time * 1e9)).units["a"]
    assert np.hypot(shown["a"][0] - true.x, shown["a"][1] - true.y) < NEAR
    files = {round(s.stamp_ns - start_ns): base64.b64encode(s.data).decode() for s in stills}
    for image in filter(lambda image: image["at"], shown["images"]):
        assert image["file"].removeprefix("data:image/webp;base64,") == files[round(1e9 * float(image["at"]))]


def test_it_plays_and_steps_and_image_and_bodies_show_the_same_instant(
    browser, run_page, short_snapshots, stills
):
    browser.open(run_page.as_uri(), until="clock.time > 0.05")  # it plays by itself
    assert browser.evaluate("clock.playing")
    # A page that is hidden, or stalls, draws no frames meanwhile; the time of two frames is all that counts.
    assert 0.0 < browser.evaluate(STALL) <= 2 * 0.25 + 1e-6
    browser.press(" ")
    assert not browser.evaluate("clock.playing")
    seen = [browser.evaluate("clock.time")]
    for key in ("ArrowRight",) * 12 + ("ArrowLeft",):
        browser.press(key)
        shown = browser.evaluate(SHOWN)
        assert_one_instant(shown, short_snapshots, stills)
        seen.append(shown["time"])
    assert all(0.0 < b - a < 0.46 for a, b in pairwise(seen[:-1]))
    assert seen[-1] < seen[-2]
    # A step ends at the instant of every image on its way.
    taken = [(still.stamp_ns - short_snapshots[0].stamp_ns) * 1e-9 for still in stills]
    passed = [time for time in taken if seen[0] < time < seen[-2]]
    assert passed
    assert all(min(abs(time - at) for at in seen) < 1e-6 for time in passed)
    browser.press("n")  # the next event
    assert browser.evaluate(SHOWN)["time"] in browser.evaluate("data.replay.events.map(({time}) => time)")
    assert browser.console == []
    assert browser.requests == [run_page.as_uri()]


def test_it_is_small_and_asks_for_nothing_outside_of_itself(run_page):
    text = run_page.read_text()
    assert len(text) < 4e6
    assert "default-src 'none'" in text
    vendored = (
        page.viewer_script(),
        *(page.web_file(f"vendor/uPlot.{name}") for name in ("min.js", "LICENSE")),
    )
    for part in vendored:
        text = text.replace(part, "")
    assert not re.search(r"""<(script|link|img)[^>]*(src|href)\s*=|https?://|@import""", text)


@pytest.mark.nightly
def test_scrubbing_and_jumps_lead_to_their_times(browser, run_page, short_snapshots, stills):
    browser.open(f"{run_page.as_uri()}#t=1.0")
    end = browser.evaluate("clock.end")
    for share in (0.2, 0.7):
        browser.click("$('time')", (share, 0.5))
        assert browser.evaluate("clock.time") == pytest.approx(share * end, abs=0.25)
        assert_one_instant(browser.evaluate(SHOWN), short_snapshots, stills)
    browser.click("[...document.querySelectorAll('#phases button')].find((b) => b.textContent === 'dock')")
    dock = next(s.stamp_ns for s in short_snapshots if s.first.phase_text == "dock")
    dock -= short_snapshots[0].stamp_ns
    assert browser.evaluate("clock.time") == pytest.approx(dock * 1e-9, abs=0.05)
    events = browser.evaluate("data.replay.events")
    for i, event in enumerate(events):
        browser.click(f"document.querySelectorAll('#events button')[{i}]")
        assert browser.evaluate("clock.time") == pytest.approx(min(event["time"], end))
        assert_one_instant(browser.evaluate(SHOWN), short_snapshots, stills)
    assert "a: on purpose" in set(
        browser.evaluate("[...document.querySelectorAll('#events .alarm span')].map((e) => e.textContent)")
    )
    browser.click("document.querySelector('.plot .u-over')", (0.5, 0.5))
    assert browser.evaluate("clock.time") == pytest.approx(0.5 * end, abs=0.1)
    browser.evaluate("$('speed').value = 4")
    browser.click("$('play')")
    browser.wait("!clock.playing")
    assert browser.evaluate("clock.time") == end
    assert browser.console == []


@pytest.mark.nightly
def test_the_keyboard_alone_suffices(browser, run_page):
    """The tabulator reaches every control, which has a name and shows its focus; keys do the rest."""
    browser.open(f"{run_page.as_uri()}#t=1.0")
    focus = """(() => { const e = document.activeElement, style = getComputedStyle(e); return {
      id: e.id || e.tagName, name: e.getAttribute("aria-label") || e.textContent || e.title,
      ring: parseFloat(style.outlineWidth) * (style.outlineStyle !== "none")}; })()"""
    reached = {}
    for _ in range(60):
        browser.press("Tab")
        element = browser.evaluate(focus)
        if element["id"] == "BODY":
            break
        assert element["name"].strip(), element
        assert element["ring"] >= 2.0, element
        reached[element["id"]] = element
    assert {"theme", "pane", "play", "back", "forward", "speed", "time", "SUMMARY", "BUTTON"} <= set(reached)
    end = browser.evaluate("clock.end")
    for key, shift, time in (
        ("End", 0, end),
        ("Home", 0, 0.0),
        ("ArrowRight", 1, 1.0),
        ("ArrowLeft", 1, 0.0),
    ):
        browser.evaluate("$('time').focus()")
        browser.press(key, shift=bool(shift))
        assert browser.evaluate("clock.time") == pytest.approx(time), key
    browser.evaluate("$('play').focus()")
    browser.press(" ")  # pressed once, not by the button and the page
    assert browser.evaluate("clock.playing")
    browser.press("Enter")
    assert not browser.evaluate("clock.playing")
    browser.press("PageDown")
    phases = browser.evaluate("data.replay.rows[0].map(({from}) => from)")
    assert browser.evaluate("clock.time") in phases
    before = browser.evaluate("camera.position.toArray()")
    browser.evaluate("$('pane').focus()")
    browser.press("d")
    browser.press("+")
    after = browser.evaluate("camera.position.toArray()")
    assert np.linalg.norm(after) == pytest.approx(np.linalg.norm(before) / 1.1)
    assert np.linalg.norm(np.subtract(after, before)) > 0.1 * np.linalg.norm(before)
    assert browser.console == []


@pytest.mark.nightly
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("size", [(1400, 900), (600, 900)], ids=["wide", "narrow"])
def test_it_fits_the_window_in_light_and_dark(browser, run_page, short_log, size, dark):
    browser.open(f"{run_page.as_uri()}#t=5.0", size, dark)
    assert browser.evaluate("document.documentElement.scrollWidth") <= size[0]
    cut = """[...document.querySelectorAll("section, figure, .plot, #bar *")].filter((e) => {
      const {left, right} = e.getBoundingClientRect(); return left < 0 || right > innerWidth; }).length"""
    assert browser.evaluate(cut) == 0
    image = browser.picture()
    assert (image[:60].mean() < 80) == dark
    units = short_log.header.scene.units
    assert {short_log.header.scene.tag_ids(unit)["tag_top"] for unit in units} & browser.tags_in(image)
    lines = browser.evaluate(SHOWN)["lines"]
    browser.click("$('theme')")
    assert (browser.picture()[:60].mean() < 80) != dark
    assert browser.evaluate(SHOWN)["lines"] == pytest.approx(lines, abs=1.0)
    assert min(lines) > browser.evaluate("document.querySelector('.u-over').getBoundingClientRect().left")
    assert browser.evaluate("document.querySelectorAll('.dg').length") == 0  # no raw tree of nodes
    assert browser.console == []


@pytest.mark.nightly
def test_a_link_to_a_time_is_followed_in_the_open_page(browser, run_page):
    browser.open(f"{run_page.as_uri()}#t=1.2.3")  # no time
    assert browser.evaluate("Number.isFinite(clock.time)")
    browser.evaluate("location.hash = '#t=2.5'")
    browser.wait("clock.time === 2.5 && !clock.playing")
    browser.press("N")  # with Shift or Caps Lock too
    assert browser.evaluate("clock.time") > 2.5
    assert browser.console == []


@pytest.mark.nightly
def test_limits_have_names_and_numbers_are_the_same_everywhere(browser, run_page):
    browser.open(run_page.as_uri())
    browser.call("Emulation.setUserAgentOverride", userAgent="any", acceptLanguage="de-DE")
    browser.call("Page.reload")
    browser.wait("document.readyState === 'complete' && navigator.language === 'de-DE'")
    assert browser.evaluate("uPlot.fmtNum(1234.5)") == "1.234,5"
    assert browser.evaluate("buildPlot(data.replay.plots[''][0]).axes[1].values(null, [1000, 0.5])") == [
        "1000",
        "0.5",
    ]
    assert "judge 20" in browser.evaluate("document.querySelector('#plots').textContent")


@pytest.mark.nightly
def test_bodies_and_scenes_may_have_any_names(browser, drive, tmp_path):
    units = {"constructor" if name == "b" else name: unit for name, unit in drive.scene.units.items()}
    scene = drive.scene.model_copy(
        update={"description": "long" * 100, "units": units, "docks": (), "plan": ()}
    )
    path = write_replay(tmp_path / "replay.html", scene, [replace(drive.snapshots[0], units={})])
    browser.open(path.as_uri(), (390, 844))
    assert browser.evaluate("viewer.scene_tree.find(['units', 'constructor']).object.children.length") > 5
    assert browser.evaluate("document.documentElement.scrollWidth") == 390
    assert browser.console == []


@pytest.mark.nightly
def test_a_pane_that_is_higher_than_wide_shows_all_units(browser, run_page):
    browser.open(f"{run_page.as_uri()}#t=0.0", (900, 1400))
    browser.evaluate("Object.assign($('pane').style, {width: '400px', height: '700px'})")
    browser.picture()
    assert browser.evaluate("camera.aspect") < 0.7
    farthest = """Math.max(...Object.keys(data.colours).flatMap((name) => {
      const body = viewer.scene_tree.find(["units", name]).object;
      return [[0.1, 0.1], [0.1, -0.1], [-0.1, 0.1], [-0.1, -0.1]].map(([x, y]) =>
        Math.abs(body.localToWorld(body.position.clone().set(x, y, 0.1)).project(camera).x)); }))"""
    assert 0.4 < browser.evaluate(farthest) < 1.0


@pytest.mark.nightly
def test_it_shows_units_tags_and_paths(browser, drive, tmp_path):
    path = write_replay(tmp_path / "replay.html", drive.scene, drive.snapshots)
    image = browser.screenshot(f"{path.as_uri()}#t=3.0")
    browser.assert_shows_the_trial(image, drive.scene)
    assert browser.pixels_of(image, palette.CLEARANCE) > 50


@pytest.mark.nightly
def test_a_trial_far_from_the_origin_is_in_view(browser, drive, tmp_path):
    def moved(X):
        return SE2(X.x + 30.0, X.y - 20.0, X.yaw)

    near = replace(drive.snapshots[100], clearance=None)
    far = with_step(
        replace(
            near,
            units={name: moved(X) for name, X in near.units.items()},
            obstacles={name: moved(X) for name, X in near.obstacles.items()},
        ),
        estimate=moved(near.first.estimate),
    )
    image = browser.screenshot(write_replay(tmp_path / "far.html", drive.scene, [far]).as_uri())
    assert {drive.scene.tag_ids(unit)["tag_top"] for unit in drive.scene.units} <= browser.tags_in(image)


def test_plots_hold_the_errors_of_every_unit_under_way(drive, tmp_path):
    """The belief of the drive is off on purpose, and the plot shows by how much."""
    text = write_replay(tmp_path / "replay.html", drive.scene, drive.snapshots).read_text()
    data = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.S)[1])
    plots = {plot["title"]: plot for plot in data["replay"]["plots"]["a"]}
    assert {"lateral [mm]", "heading [deg]", "line of sight [deg]", "v [m/s]", "w [rad/s]"} <= plots.keys()
    assert data["replay"]["plots"][""][0]["title"] == "clearance [mm]"
    truth, believed = (np.array(curve["values"], dtype=float) for curve in plots["lateral [mm]"]["curves"])
    scene, port = drive.scene, drive.scene.docks[0].port
    for time, a, b in zip(plots["lateral [mm]"]["times"], truth, believed, strict=True):
        snapshot = min(drive.snapshots, key=lambda s: abs(s.stamp_ns * 1e-9 - time))
        X_WD = target_frame(scene, scene.docks[0], snapshot.units)
        for X_WU, shown in ((snapshot.units["a"], a), (snapshot.first.estimate, b)):
            if X_WU is None:
                assert np.isnan(shown)
                continue
            X_DP = X_WD.inverse() @ X_WU @ scene.geometry("a").port(port)
            assert 1e3 * X_DP.y == pytest.approx(shown, rel=1e-3, abs=1e-3)
    assert np.nanmax(np.abs(believed - truth)) > 1.0


def test_the_same_trial_gives_the_same_replay(drive, tmp_path):
    first = write_replay(tmp_path / "a.html", drive.scene, drive.snapshots).read_bytes()
    assert first == write_replay(tmp_path / "b.html", drive.scene, iter(drive.snapshots)).read_bytes()


def test_one_bare_snapshot_is_shown_and_none_is_refused(drive, tmp_path):
    bare = replace(drive.snapshots[0], steps=(), clearance=None)
    assert write_replay(tmp_path / "one.html", drive.scene, [bare]).is_file()
    with pytest.raises(MsrrError, match="without a single snapshot"):
        write_replay(tmp_path / "none.html", drive.scene, [])
