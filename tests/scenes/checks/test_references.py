"""Checks of names, numbers and values: each contradiction is found, placed and mended."""

from collections.abc import Mapping

import pytest

from msrr_scenes import load_scene
from msrr_scenes.errors import SceneError


@pytest.mark.parametrize(
    ("overrides", "place", "mend"),
    [
        ({"plan": "[]"}, "plan", "expected at least 1 entry, or a shape"),
        ({"plan.0.to": "d.rear"}, "plan.0.to", "no unit named 'd'"),
        ({"plan.0.unit": "aa"}, "plan.0.unit", "Units: b, a, c"),
        ({"plan.0.to": "a.rear"}, "plan.0.to", "cannot dock to itself"),
        ({"plan.0.to": "b.front"}, "plan.0.to", "passive ports: rear, left, right"),
        ({"plan.0": "{unit: a, dock_to: b.rear}"}, "plan.0.dock_to", "Keys here: unit, port, to, calibrate"),
        ({"plan.0.to": "b.rera"}, "plan.0.to", "did you mean 'rear'?"),
        ({"plan.0.to": "b.bak"}, "plan.0.to", "no port 'bak'. Passive ports: rear, left, right"),
        ({"plan.0.port": "font"}, "plan.0.port", "did you mean 'front'? Active ports: front"),
        ({"plan.0.port": "rear"}, "plan.0.port", "active ports: front"),
        ({"units.a.pose.frame": "a.rear"}, "units.a.pose.frame", "relative to itself"),
        ({"units.b.pose": "{frame: a.rear}"}, "units.b.pose.frame", "(b -> a -> b)"),
        ({"units.a.pose.frame": "d.rear"}, "units.a.pose.frame", "no unit named 'd'"),
        ({"units.a.pose.frame": "b.top"}, "units.a.pose.frame", "Ports: front, rear, left, right"),
        ({"units.c.number": "0"}, "units.c.number", "2 is free"),
        ({"units.a.tag_ids": "{tag_top: 500}"}, "obstacles.post.tag_id", "which a/tag_top has already"),
        (
            {"units.a.tag_ids": "{tag_top: 587}"},
            "units.a.tag_ids.tag_top",
            "the family tag36h11 has 0 .. 586",
        ),
        ({"units.a.tag_ids": "{tag_bottom: 3}"}, "units.a.tag_ids.tag_bottom", "Links with a tag"),
        ({"obstacles.post.tag_id": "11"}, "obstacles.post.tag_id", "which b/"),
        ({"arena.x_m": "[2, -2]"}, "arena.x_m", "[low, high]"),
        ({"los.inner_deg": "31"}, "los.inner_deg", "below los.outer_deg"),
        ({"los.outer_deg": "40"}, "los.outer_deg", "raise cameras.onboard.hfov_deg"),
        ({"control.rate_hz": "480"}, "control.rate_hz", "raise physics_hz"),
        ({"limits.v_close_mps": "0.5"}, "limits.v_close_mps", "limits.v_max_mps = 0.4"),
        ({"faults": "[{kind: marker_hidden, unit: d}]"}, "faults.0.unit", "no unit named 'd'"),
        ({"faults": "[{kind: port_plugged, unit: b, port: front}]"}, "faults.0.port", "passive ports"),
        (
            {"faults": "[{kind: port_plugged, unit: b, port: rear, attempts: [0]}]"},
            "faults.0.attempts.0",
            "greater than or equal to 1",
        ),
        (
            {"faults": "[{kind: camera_blackout, camera: a/onbord, from_s: 0, to_s: 1}]"},
            "faults.0.camera",
            "did you mean 'a/onboard'?",
        ),
        (
            {"faults": "[{kind: camera_blackout, camera: overhed, from_s: 0, to_s: 1}]"},
            "faults.0.camera",
            "did you mean 'overhead'? Cameras: overhead, b/onboard",
        ),
        (
            {
                "cameras.overhead": "null",
                "faults": "[{kind: camera_blackout, camera: overhead, from_s: 0, to_s: 1}]",
            },
            "faults.0.camera",
            "no camera 'overhead'. Cameras: b/onboard",
        ),
        (
            {"faults": "[{kind: camera_blackout, camera: overhead, from_s: 2, to_s: 1}]"},
            "faults.0.to_s",
            "ends before",
        ),
        (
            {"obstacles.a": "{shape: box, length_m: 1, width_m: 1}"},
            "obstacles.a",
            "names of bodies have to differ",
        ),
        (
            {"obstacles.world": "{shape: box, length_m: 0.1, width_m: 0.1, pose: {x_m: -1.5}}"},
            "obstacles.world",
            "the name of the world frame in logs",
        ),
        ({"units.base_station": "{number: 5, pose: {x_m: -1.5}}"}, "units.base_station", "another one"),
        ({"units.overhead": "{number: 5, pose: {x_m: -1.5}}"}, "units.overhead", "the overhead camera in"),
        ({"units.c.urdf": "none.urdf"}, "units.c.urdf", "no URDF named 'none.urdf'"),
    ],
)
def test_contradicting_names_numbers_and_values(overrides: Mapping[str, str], place: str, mend: str) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene("bystander", overrides)
    assert f": {place}: " in str(caught.value)
    assert mend in str(caught.value)


def test_mistakes_of_one_kind_are_told_in_the_order_of_the_file() -> None:
    slots = [f"tag_{letter}" for letter in "gfedcba"]
    written = ", ".join(f"{slot}: {510 + k}" for k, slot in enumerate(slots))
    with pytest.raises(SceneError) as caught:
        load_scene("bystander", {"units.a.tag_ids": f"{{{written}}}"})
    told = [line for line in str(caught.value).splitlines() if "no such tag link" in line]
    assert [line.partition("tag_ids.")[2].partition(":")[0] for line in told] == slots
