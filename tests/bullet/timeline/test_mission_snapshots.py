"""Snapshots of a mission: the same live and from the log, with every unit and what the base station knows."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from msrr_bullet.timeline.interpolation import SnapshotInterpolator
from msrr_bullet.timeline.mission_series import EventKind, activity_spans, silent_spans, unit_events
from msrr_bullet.timeline.mission_snapshot import SILENT_NS, Activity
from msrr_bullet.timeline.mission_table import mission_text, unit_rows
from msrr_bullet.timeline.routes import Routes, part_of
from msrr_scenes.messages.coordination import MissionState, UnitState


def test_a_running_trial_shows_what_its_log_gives(mission_run):
    assert len(mission_run.live) == len(mission_run.snapshots) > 500
    for live, logged in zip(mission_run.live, mission_run.snapshots, strict=True):
        assert (live.stamp_ns, live.units, live.obstacles) == (
            logged.stamp_ns,
            logged.units,
            logged.obstacles,
        )
        assert live.clearance == logged.clearance
        assert [step.key for step in live.steps] == [step.key for step in logged.steps]
        for a, b in zip(live.steps, logged.steps, strict=True):
            assert (a.estimate, a.phase, a.attempt) == (b.estimate, b.phase, b.attempt)
            assert repr(a.los) == repr(b.los)  # NaN is not equal to itself
            assert (a.twist, a.reason, a.monitor, a.assembly) == (b.twist, b.reason, b.monitor, b.assembly)
            assert a.path == b.path
        a, b = live.mission, logged.mission
        assert (a.status, a.reports, a.authorities, a.heard_ns) == (
            b.status,
            b.reports,
            b.authorities,
            b.heard_ns,
        )


def test_a_unit_that_drives_into_the_open_is_under_way_without_a_step(mission_run):
    root = next(u.unit for u in mission_run.snapshots[-1].mission.status.units if u.task == "p0")
    steps = [step for s in mission_run.snapshots for step in s.steps if step.unit == root]
    assert steps
    assert {step.step for step in steps} == {None}
    assert all(step.path is not None for step in steps if step.assembly and step.assembly.stage == "drive")
    others = {step.unit for s in mission_run.snapshots for step in s.steps if step.step is not None}
    assert others == set("abcd") - {root}
    moving = next(s for s in mission_run.snapshots if s.of_unit(root).steps)
    assert moving.of_unit(root).first.unit == root
    assert moving.of_unit(root).first.step is None


def test_the_interpolator_keeps_what_the_base_station_knows(mission_run):
    trial = SnapshotInterpolator(mission_run.snapshots)
    a, b = mission_run.snapshots[200:202]
    between = trial.at((a.stamp_ns + b.stamp_ns) // 2)
    assert between.mission is a.mission
    assert [step.key for step in between.steps] == [step.key for step in a.steps]


def test_every_unit_does_something_at_every_time(mission_run):
    """The spans of a unit follow each other from the beginning to the end, and end in its place."""
    end = mission_run.snapshots[-1].stamp_ns * 1e-9
    for unit in mission_run.log.header.scene.units:
        spans = list(activity_spans(mission_run.snapshots, unit))
        assert (spans[0].start_s, spans[-1].end_s) == (0.0, pytest.approx(end))
        assert all(a.end_s == b.start_s for a, b in pairwise(spans))
        assert spans[-1].activity is Activity.IN_PLACE
        assert any(span.activity is Activity.DRIVING for span in spans)
        assert all((span.waits_for is not None) == (span.activity is Activity.WAITING) for span in spans)


def test_the_events_of_a_mission_are_its_routes_and_docks(mission_run):
    last = mission_run.snapshots[-1].mission
    for unit in mission_run.log.header.scene.units:
        events = list(unit_events(mission_run.snapshots, unit))
        assert [e.time_s for e in events] == sorted(e.time_s for e in events)
        granted = [e for e in events if e.kind is EventKind.GRANTED]
        assert len(granted) == last.of(unit).route
        docks = [e.text for e in events if e.kind is EventKind.DOCKED]
        assert docks == ([] if last.docked_to(unit) is None else [last.docked_to(unit)])
    assert last.status.state is MissionState.COMPLETE
    assert sum(last.docked_to(unit) is not None for unit in "abcd") == 3


def test_a_silent_unit_is_shown_from_when_the_base_station_counts_it_as_silent(mission_run):
    """The radio of c is silent from 2 s to 5 s."""
    (span,) = silent_spans(mission_run.snapshots, "c")
    heard = next(s for s in mission_run.snapshots if s.stamp_ns >= 2_100_000_000).mission.heard_ns["c"]
    assert abs(span[0] - 1e-9 * (heard + SILENT_NS)) < 0.05
    assert 5.0 <= span[1] < 5.4
    assert not list(silent_spans(mission_run.snapshots, "a"))
    snapshot = next(s for s in mission_run.snapshots if s.stamp_ns >= 4_500_000_000)
    does = {row.unit: row.does for row in unit_rows(snapshot)}
    assert "not heard for 3 s" in does["c"]
    assert "not heard" not in does["a"]


def test_units_drive_on_the_routes_that_were_granted(mission_run):
    """What is drawn as a route is where the unit drives, as far as it may."""
    routes = Routes(mission_run.log.header.scene)
    checked = 0
    for snapshot in mission_run.snapshots[::10]:
        for unit in snapshot.units:
            authority = snapshot.mission.granted(unit)
            if authority is None or snapshot.mission.activity(unit) is not Activity.DRIVING:
                continue
            route = routes.of(authority)
            assert route.length == snapshot.mission.of(unit).length
            granted = part_of(route, 0.0, authority.limit)
            assert np.hypot(*(granted - snapshot.units[unit].translation).T).min() < 0.06
            checked += 1
    assert checked > 20


def test_a_part_of_a_route_ends_where_it_should(mission_run):
    authority = next(s.mission.granted("c") for s in mission_run.snapshots if s.mission.granted("c"))
    route = Routes(mission_run.log.header.scene).of(authority)
    first, second = part_of(route, 0.0, 0.7), part_of(route, 0.7, route.length)
    np.testing.assert_allclose(first[-1], second[0])
    np.testing.assert_allclose(second[-1], route.poses[:, :2][-1])
    way = np.hypot(*np.diff(np.concatenate([first, second]), axis=0).T).sum()
    assert way <= route.length + 1e-6
    assert len(part_of(route, 0.5, 0.5)) == len(part_of(route, 0.5, 0.2)) == 0


def test_words_tell_who_waits_and_why_somebody_failed(mission_run):
    snapshot = mission_run.waiting
    waiting = next(u for u in snapshot.units if snapshot.mission.waits_for(u))
    row = next(row for row in unit_rows(snapshot) if row.unit == waiting)
    assert row.does.startswith("waiting")
    assert row.waits_for == snapshot.mission.waits_for(waiting)
    assert "waiting: " in mission_text(snapshot.mission)
    lost = tuple(
        replace(u, state=UnitState.FAILED, reason="not heard for 60 s") if u.unit == waiting else u
        for u in snapshot.mission.status.units
    )
    failed = replace(
        snapshot, mission=replace(snapshot.mission, status=replace(snapshot.mission.status, units=lost))
    )
    assert failed.mission.activity(waiting) is Activity.FAILED
    assert failed.mission.granted(waiting) is None
    row = next(row for row in unit_rows(failed) if row.unit == waiting)
    assert (row.does, row.reason) == ("failed", "not heard for 60 s")
    (event,) = unit_events([snapshot, failed], waiting)
    assert (event.kind, event.text) == (EventKind.FAILED, "not heard for 60 s")
