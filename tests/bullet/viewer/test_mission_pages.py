"""Pages of a mission: replay and live view show units, routes, who waits for whom, and a table."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from msrr_bullet.timeline import palette
from msrr_bullet.viewer.live import LiveViewer
from msrr_bullet.viewer.mission_nodes import WAITS_OFF, MissionNodes
from msrr_bullet.viewer.plots import plots_of_run
from msrr_bullet.viewer.readings import HEADINGS, UNIT_READINGS, changes, readings, unit_readings
from msrr_bullet.viewer.replay_page import write_replay
from msrr_bullet.viewer.scene_graph import framed, places


@pytest.fixture(scope="module")
def waiting(mission_run):
    """An instant at which a unit waits."""
    return mission_run.waiting


@pytest.fixture(scope="module")
def nodes(mission_run):
    return MissionNodes(mission_run.log.header.scene)


def assert_shows_the_mission(browser, image, scene):
    for unit, colour in palette.unit_colours(scene).items():
        assert browser.pixels_of_hue(image, colour) > 300, unit
    assert browser.pixels_of(image, palette.ALARM) > 20, "arrow to the unit that is waited for"
    assert browser.pixels_of(image, palette.BELIEF) > 30, "where units believe they are"


def test_the_replay_shows_units_and_who_waits_without_errors(browser, mission_run, waiting, tmp_path):
    scene = mission_run.log.header.scene
    path = write_replay(tmp_path / "replay.html", scene, mission_run.snapshots)
    assert path.stat().st_size < 4e6
    image = browser.screenshot(f"{path.as_uri()}#t={waiting.stamp_ns * 1e-9:.3f}")
    assert_shows_the_mission(browser, image, scene)
    assert browser.console == []
    # It follows the unit that docks until the reader picks another one.
    shown = {s.watched.unit: s.stamp_ns * 1e-9 for s in mission_run.snapshots if s.watched is not None}
    assert len(shown) > 1
    for unit, time in shown.items():
        assert browser.evaluate(f"seek({time}), chosen") == unit
    browser.evaluate("pick('c')")
    assert {browser.evaluate(f"seek({time}), chosen") for time in shown.values()} == {"c"}


def test_the_live_view_shows_the_same(browser, mission_run, waiting):
    scene = mission_run.log.header.scene
    with LiveViewer(scene, port=0) as viewer:
        for snapshot in mission_run.snapshots:
            if snapshot.stamp_ns < waiting.stamp_ns:
                viewer.update(snapshot)
        viewer.show(waiting)
        image = browser.screenshot(viewer.url, until="latest")
    assert_shows_the_mission(browser, image, scene)
    assert browser.console == []


def test_the_page_of_a_mission_has_a_row_for_every_unit(mission_run, tmp_path):
    scene = mission_run.log.header.scene
    text = write_replay(tmp_path / "replay.html", scene, mission_run.snapshots).read_text()
    data = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.S)[1])
    assert list(data["colours"]) == list(data["replay"]["units"]) == list(scene.units)
    assert len(data["replay"]["rows"]) == len(scene.units)
    assert all(
        len(columns) == len(HEADINGS) + len(UNIT_READINGS) for columns in data["replay"]["units"].values()
    )


def test_a_unit_that_only_drives_into_the_open_has_no_empty_plots(mission_run):
    plots = plots_of_run(mission_run.log.header.scene, mission_run.snapshots)
    assert all(plot["curves"] for own in plots.values() for plot in own)
    docks = {"lateral [mm]", "line of sight [deg]"}
    shown = [docks <= {plot["title"] for plot in own} for unit, own in plots.items() if unit]
    assert any(shown)
    assert not all(shown)


def test_changes_give_back_every_text():
    columns = [["a", "a", "b", "b", "a"], ["x"] * 5]
    for column, (starts, texts) in zip(columns, changes(columns), strict=True):
        assert [texts[np.searchsorted(starts, i, side="right") - 1] for i in range(5)] == column
    assert changes([["x"] * 5]) == [[[0], ["x"]]]


def test_readings_tell_what_each_unit_does(mission_run, waiting):
    unit = next(u for u in waiting.units if waiting.mission.waits_for(u))
    row = unit_readings(waiting)[unit]
    assert row[:2] == (unit, "waiting")
    assert row[HEADINGS.index("waits for")] == waiting.mission.waits_for(unit)
    assert all(len(r) == len(HEADINGS) + len(UNIT_READINGS) for r in unit_readings(waiting).values())
    assert readings(waiting, ["mission"])[0].startswith("running")


def test_an_arrow_leads_from_the_unit_that_waits_to_the_other_one(nodes, waiting):
    unit = next(u for u in waiting.units if waiting.mission.waits_for(u))
    placed = dict(nodes.node_states(waiting))
    head, shaft = placed[f"waits/{unit}/head"], placed[f"waits/{unit}/shaft"]
    target = waiting.units[waiting.mission.waits_for(unit)].translation
    assert abs(np.linalg.norm(head.X.p[:2] - target) - WAITS_OFF) < 1e-6
    assert head.visible
    assert shaft.visible
    others = [p for node, p in placed.items() if node.startswith("waits/") and f"/{unit}/" not in node]
    assert any(not p.visible for p in others)


def test_a_docked_pair_is_marked_at_its_port(nodes, mission_run):
    before, after = mission_run.snapshots[0], mission_run.snapshots[-1]
    assert not any(p.visible for node, p in nodes.node_states(before) if node.startswith("joints/"))
    marked = {node for node, p in nodes.node_states(after) if node.startswith("joints/") and p.visible}
    assert marked == {f"joints/{u}" for u in "abcd" if after.mission.docked_to(u)}


def test_ways_and_routes_appear_with_time(nodes, mission_run):
    """A piece of a way shows from when it was driven; a route while it is granted and not yet driven."""
    snapshots = mission_run.snapshots[::5]
    commands, tracks = nodes.replay(snapshots)
    assert commands
    ways = [track for track in tracks if track.path.startswith("way/")]
    assert len(ways) > 10
    for track in ways:
        assert not track.values[0]
        assert track.values[-1]
        assert (np.diff(track.values.astype(int)) >= 0).all()
    routes = [track for track in tracks if re.fullmatch(r"route/\w_\d+", track.path)]
    last = mission_run.snapshots[-1].mission
    assert len(routes) == sum(unit.route for unit in last.status.units)
    assert all(track.values.any() and not track.values[-1] for track in routes)
    assert any(track.path.count("/") == 2 for track in tracks)


def test_the_live_view_draws_a_route_again_only_when_it_has_changed(mission_run, waiting):
    nodes = MissionNodes(mission_run.log.header.scene)
    first = [command.key for command in nodes.live_routes(waiting)]
    assert any("granted" in key for key in first)
    assert list(nodes.live_routes(waiting)) == []
    nobody = replace(waiting, mission=replace(waiting.mission, authorities={}))
    hidden = list(nodes.live_routes(nobody))
    assert {command.key for command in hidden} == {
        f"property route/{u} visible" for u in waiting.units if waiting.mission.granted(u)
    }


def test_a_scene_without_a_base_station_has_no_such_nodes(drive):
    nodes = MissionNodes(drive.scene)
    assert not list(nodes.build())
    assert not list(nodes.node_states(drive.snapshots[0]))
    assert not list(nodes.live_routes(drive.snapshots[0]))


def test_the_live_view_is_moved_back_only_when_a_body_has_driven_out_of_it(mission_run):
    """It showed what was there at the start: units that drove off were beside it for the rest of the run."""
    viewer = LiveViewer.__new__(LiveViewer)  # without a server
    viewer._framed = None
    start = places(mission_run.snapshots[:1])
    assert list(viewer._look_again(start))
    before = framed(viewer._framed)
    assert not list(viewer._look_again(start))
    assert not list(viewer._look_again(start + 0.1))
    for way in np.array([[3.0, 0.0], [0.0, -4.0]]):
        far = start + way
        assert list(viewer._look_again(far))
        assert not list(viewer._look_again(far))
        middle, radius = framed(viewer._framed)
        assert radius > before[1]
        assert np.hypot(*(np.concatenate([start, far]) - middle).T).max() < radius
