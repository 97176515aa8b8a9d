"""Nodes of a scene and their states."""

from __future__ import annotations

from dataclasses import replace

from msrr_bullet.viewer.scene_graph import SceneGraph


def test_all_snapshots_have_the_same_nodes(drive):
    graph = SceneGraph(drive.scene)
    bare = replace(drive.snapshots[0], steps=(), clearance=None, obstacles={})
    nodes = {frozenset(graph.node_states(snapshot)) for snapshot in (*drive.snapshots[::40], bare)}
    assert len(nodes) == 1
    assert {"units/a", "ghost/a", "sight", "clearance/free"} <= next(iter(nodes))


def test_the_ghost_stands_at_the_estimate(drive):
    snapshot = drive.snapshots[100]
    ghost = SceneGraph(drive.scene).node_states(snapshot)["ghost/a"]
    assert ghost.visible
    assert ghost.X.to_se2().log().tolist() == snapshot.first.estimate.log().tolist()


def test_the_clearance_bar_is_red_where_the_collision_monitor_acts(drive):
    graph, guard = SceneGraph(drive.scene), drive.scene.control.guard
    snapshot = drive.snapshots[100]
    for distance, red in ((guard.slow_m + 0.01, False), (guard.slow_m - 0.01, True)):
        near = replace(snapshot.clearance, distance=distance, body_a="a", body_b="c")
        nodes = graph.node_states(replace(snapshot, clearance=near))
        assert nodes["clearance/monitored"].visible is red
        assert nodes["clearance/free"].visible is not red
        assert nodes["clearance/monitored" if red else "clearance/free"].scale[0] == distance
