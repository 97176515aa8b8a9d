"""Commands to the page: repeatable, and only where something changes."""

from __future__ import annotations

import meshcat.geometry as g
import numpy as np
import umsgpack

from msrr_bullet.viewer.commands import HIDDEN, KeyframeTrack, NodeState, place, set_object
from msrr_scenes.geometry.se3 import SE3


def test_the_same_shape_gives_the_same_bytes() -> None:
    first, second = (
        set_object("a/b", g.Box([1.0, 2.0, 3.0]), g.MeshBasicMaterial(color=7)) for _ in range(2)
    )
    assert first == second
    assert umsgpack.unpackb(first.data)["path"] == "a/b"


def test_only_changes_of_a_state_are_sent() -> None:
    here, there = NodeState(), NodeState(SE3(p=np.array([1.0, 0.0, 0.0])))
    assert [c.key for c in place("n", None, here)] == ["property n visible", "transform n"]
    assert not list(place("n", here, NodeState()))
    assert [c.key for c in place("n", here, there)] == ["transform n"]
    assert [c.key for c in place("n", here, HIDDEN)] == ["property n visible"]


def test_a_thinned_track_keeps_both_ends_of_equal_values() -> None:
    times = np.arange(6.0)
    track = KeyframeTrack(
        "n", "position", "vector3", times, np.array([[0.0], [0.0], [0.0], [1.0], [1.0], [2.0]])
    ).thinned()
    assert track.times.tolist() == [0.0, 2.0, 3.0, 4.0, 5.0]
    assert track.values[:, 0].tolist() == [0.0, 0.0, 1.0, 1.0, 2.0]
