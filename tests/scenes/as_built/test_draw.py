"""The draw of what was built: its laws, the independence of its streams, and where the errors go."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.stats import chi2

from msrr_scenes.as_built import AsBuilt, BuiltDrive, as_designed, draw_as_built
from msrr_scenes.as_built.covered_tags import covered_tags
from msrr_scenes.as_built.draw import LEAST_FRICTION
from msrr_scenes.geometry.distortion import Distortion, has_inverse
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import marker_links
from msrr_scenes.loading.load import load_scene
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none

SEEDS = 200


def scene(as_built: str = "careful", name: str = "close_range", **changes: str) -> Scene:
    return load_scene(name, {"as_built": as_built, **changes})


@cache
def drawn() -> list[Mapping[str, float]]:
    careful = scene("careful")
    return [draw_as_built(careful, seed).errors for seed in range(SEEDS)]


def errors(quantity: str) -> np.ndarray:
    return np.array([each[quantity] for each in drawn()])


def test_a_perfect_grade_and_no_fault_leave_everything_as_designed() -> None:
    of = scene("perfect", "two_units")
    built = draw_as_built(of, 7)
    assert built.is_as_designed
    assert built.errors == {}
    for name, unit in built.units.items():
        assert unit.geometry is of.geometry(name)
        assert unit.drive.ideal
        assert (unit.camera.pinhole, unit.print_scale, unit.mass_scale) == (
            of.cameras.onboard.pinhole,
            1.0,
            1.0,
        )


def test_the_same_seed_gives_the_same_trial_and_another_one_gives_another() -> None:
    of = scene(name="two_units")
    first, again, other = (draw_as_built(of, seed).errors for seed in (3, 3, 4))
    assert first == again
    assert not set(first.values()) & set(other.values())
    assert len(set(first.values())) == len(first)  # no two quantities share a stream


def test_adding_an_effect_a_unit_or_a_quantity_changes_no_other_draw() -> None:
    def drawn(of: Scene) -> Mapping[str, float]:
        return draw_as_built(of, 5).errors

    plain = drawn(scene())
    more = drawn(scene("{grade: careful, floor: {ridge_m: {sigma: 0.001}}, onboard: {yaw_deg: 2}}"))
    assert more.keys() - plain.keys() == {"floor/ridge_m"}
    changed = {name for name in plain if more[name] != plain[name]}
    assert changed == {f"unit/{unit}/onboard/yaw_deg" for unit in "ab"}
    bystander = drawn(scene(name="bystander"))
    assert bystander.keys() > plain.keys()
    assert {name: bystander[name] for name in plain} == plain


def test_a_normal_error_has_the_stated_deviation() -> None:
    """The interval contains all but 1 in 10,000 samples; the seeds are fixed."""
    low, high = chi2.ppf([5e-5, 1 - 5e-5], SEEDS)
    for quantity, sigma in (
        ("onboard/yaw_deg", 0.3),
        ("tags/print_percent", 0.4),
        ("drive/track_percent", 1.0),
    ):
        assert low < float((errors(f"unit/a/{quantity}") ** 2).sum()) / sigma**2 < high
    assert (errors("unit/a/onboard/yaw_deg") < 0.0).any()


def test_lag_and_backlash_are_magnitudes_and_friction_is_lost() -> None:
    for magnitude in ("lag_ms", "backlash_deg"):
        assert (errors(f"unit/a/drive/{magnitude}") > 0.0).all()
    friction = 1.0 + 0.01 * errors("floor/friction_percent")
    assert friction.max() <= 1.0
    assert np.median(friction) == pytest.approx(math.exp(-0.5 * 0.6745), abs=0.05)
    slippery = scene("{floor: {friction_percent: {sigma: 300}}}")
    least = [draw_as_built(slippery, seed).errors["floor/friction_percent"] for seed in range(5)]
    assert 1.0 + 0.01 * min(least) == pytest.approx(LEAST_FRICTION)


def test_what_the_plant_does_not_have_is_not_drawn() -> None:
    bullet, unicycle = (draw_as_built(scene(plant=plant), 1) for plant in ("bullet", "unicycle"))
    assert {name for name in bullet.errors if name not in unicycle.errors} == {
        "floor/friction_percent",
        "floor/slope_x_deg",
        "floor/slope_y_deg",
    }
    assert all(unicycle.errors[name] == bullet.errors[name] for name in unicycle.errors)


def built(group: str, **given: float) -> AsBuilt:
    inner = ", ".join(f"{key}: {value}" for key, value in given.items())
    return draw_as_built(scene(f"{{{group}: {{{inner}}}}}"), 0)


def test_both_perceptions_look_through_the_same_lens() -> None:
    images, parametric = (draw_as_built(scene(perception=p), 1) for p in ("images", "parametric"))
    assert images.errors == parametric.errors
    assert images.units["a"].camera.distortion == parametric.units["a"].camera.distortion != Distortion()


def test_a_given_error_is_the_true_one() -> None:
    assert built("onboard", yaw_deg=2.0).errors == {f"unit/{unit}/onboard/yaw_deg": 2.0 for unit in "ab"}
    told = scene().cameras.onboard.pinhole
    true = built("onboard", focal_percent=3.0, cx_px=8.0, cy_px=-2.0, clock_ms=50.0).units["a"].camera
    assert true.pinhole.focal == pytest.approx(1.03 * told.focal)
    assert (true.pinhole.cx - told.cx, true.pinhole.cy - told.cy) == (8.0, -2.0)
    assert true.stamp(100_000_000) == 150_000_000
    early = built("onboard", clock_ms=-50.0).units["a"].camera
    assert (early.stamp(0), early.stamp(60_000_000)) == (0, 10_000_000)


def test_a_camera_is_mounted_in_its_own_frame() -> None:
    """X along the optical axis: yaw turns the view to the left, x moves it forward."""
    camera = built("onboard", x_m=0.01, yaw_deg=10.0).units["a"].camera
    X_AX = camera.mounted(SE3.from_se2(SE2(1.0, 2.0, math.radians(90.0)))).to_se2()
    assert (X_AX.x, X_AX.y) == pytest.approx((1.0, 2.01))
    assert math.degrees(X_AX.yaw) == pytest.approx(100.0)


def test_a_misaligned_camera_is_turned_and_is_not_as_designed() -> None:
    fault = "{kind: camera_misaligned, unit: a, yaw_deg: 7}"
    faulty = scene("perfect", faults=f"[{{kind: port_plugged, unit: b, port: rear}}, {fault}]")
    X_BX = not_none(as_designed(faulty).units["a"].camera.X_BX)
    turned = SE3.from_se2(SE2(0.0, 0.0, math.radians(7.0)))
    np.testing.assert_allclose(X_BX.matrix(), turned.matrix(), atol=1e-15)
    assert not as_designed(faulty).is_as_designed
    assert as_designed(faulty).units["b"].camera.X_BX is None
    mounted = draw_as_built(scene("{onboard: {x_m: 0.01, yaw_deg: 2}}", faults=f"[{fault}]"), 0)
    X_BX = not_none(mounted.units["a"].camera.X_BX)
    both = turned @ SE3.from_se2(SE2(0.01, 0.0, math.radians(2.0)))
    np.testing.assert_allclose(X_BX.matrix(), both.matrix(), atol=1e-15)


def test_errors_of_drive_and_body_are_told_in_si_units() -> None:
    drive = (
        built("drive", lag_ms=50, dead_zone_radps=0.2, backlash_deg=3, radius_left_percent=2).units["a"].drive
    )
    assert drive == BuiltDrive((1.02, 1.0), lag_s=0.05, dead_zone_radps=0.2, backlash_rad=math.radians(3.0))
    body = built("body", mass_percent=5.0, switch_travel_m=0.001).units["a"]
    assert (body.mass_scale, body.switch_travel_error_m) == (1.05, 0.001)
    assert type(built("onboard", jitter_ms=0.3).units["a"].camera.jitter_ns) is int
    weightless = draw_as_built(scene("{body: {mass_percent: {sigma: 5}}}", plant="unicycle"), 0)
    assert weightless.units["a"].mass_scale == 1.0


def test_a_bracket_moves_its_tags_together_about_their_middle() -> None:
    of, port = scene("perfect"), "rear"
    drawn = of.geometry("b")
    moved = built("bracket", roll_deg=1.0, y_m=0.003).units["b"].geometry
    X_DU = SE3.from_se2(drawn.dock_frame(port)).inverse()
    middles = []
    for geometry in (drawn, moved):
        middles.append(np.mean([(X_DU @ geometry.frame(slot)).p for slot in marker_links(port)], axis=0))
    np.testing.assert_allclose(middles[1] - middles[0], [0.0, 0.003, 0.0], atol=1e-12)
    turns = [(X_DU @ moved.frame(slot)).R @ (X_DU @ drawn.frame(slot)).R.T for slot in marker_links(port)]
    for turn in turns:
        np.testing.assert_allclose(turn, SE3.from_xyz_rpy((0, 0, 0), (math.radians(1.0), 0, 0)).R, atol=1e-12)
    others = moved.frames.keys() - {slot for p in drawn.passive_ports for slot in marker_links(p)}
    assert all(moved.frame(name) is drawn.frame(name) for name in others)


def test_a_tag_moves_in_its_own_frame_and_the_top_tag_as_well() -> None:
    drawn = scene("perfect").geometry("a")
    moved = built("tags", x_m=0.001, z_m=-0.002).units["a"].geometry
    for slot in drawn.tag_slots:
        X_TX = drawn.frame(slot).inverse() @ moved.frame(slot)
        np.testing.assert_allclose(X_TX.p, [0.001, 0.0, -0.002], atol=1e-12)
    assert built("tags", print_percent=3.0).units["a"].print_scale == pytest.approx(1.03)


def test_the_tag_of_an_obstacle_stays_flat_on_its_lid() -> None:
    tags = draw_as_built(scene("rough", "two_units"), 0).obstacle_tags
    assert tags.keys() == {"post"}
    X_TX = not_none(tags["post"].X_TX)
    assert X_TX.p[2] == 0.0
    np.testing.assert_allclose(X_TX.R[2], [0.0, 0.0, 1.0])
    assert tags["post"].print_scale != 1.0


def test_the_lens_is_that_of_opencv() -> None:
    lens, rng = Distortion(k1=-0.2, k2=0.05, p1=0.002, p2=-0.003, k3=0.01), np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-0.7, 0.7, 50), rng.uniform(-0.5, 0.5, 50), np.ones(50)])
    camera = (
        draw_as_built(
            scene(
                "{onboard: {k1: -0.2, k2: 0.05, p1: 0.002, p2: -0.003, k3: 0.01}}", perception="parametric"
            ),
            0,
        )
        .units["a"]
        .camera
    )
    assert camera.distortion == lens
    expected, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.pinhole.matrix(), np.array([-0.2, 0.05, 0.002, -0.003, 0.01])
    )
    np.testing.assert_allclose(camera.project(points), expected[:, 0], atol=1e-9)


def test_a_lens_that_shows_a_point_twice_is_drawn_anew() -> None:
    """Of such wide lenses one in five was, and its trial ended with an error."""
    wide = scene("careful", **{"cameras.onboard.hfov_deg": "140"})
    folded = 0
    for seed in range(40):
        built = draw_as_built(wide, seed)
        camera = built.units["a"].camera
        assert has_inverse(camera.pinhole, camera.distortion)
        assert built.errors["unit/a/onboard/k1"] == camera.distortion.k1
        sigma = wide.as_built.onboard.k1.sigma
        first = sigma * stream(seed, "as_built/unit/a/onboard/k1").standard_normal()
        folded += camera.distortion.k1 != pytest.approx(first)
    assert 0 < folded < 20


def test_no_plate_passes_through_another_tag() -> None:
    """Of rough units one in five is drawn again; what is drawn of others, and of all else, stays the same."""
    rough, again = scene("rough"), 0
    for seed in range(40):
        built = draw_as_built(rough, seed)
        for name, unit in built.units.items():
            slots = unit.geometry.tag_slots
            sizes = unit.print_scale * np.array([rough.tag_size(name, slot) for slot in slots])
            poses = [unit.geometry.frame(slot) for slot in slots]
            assert not covered_tags(poses, sizes, rough.tags.tag_family.plate_ratio).any()
            key = f"unit/{name}/bracket/rear/x_m"
            first = stream(seed, f"as_built/{key}").standard_normal()
            again += built.errors[key] != pytest.approx(rough.as_built.bracket.x_m.sigma * float(first))
    assert 0 < again < 40  # of 80


def test_a_plate_covers_a_tag_where_one_of_their_edges_passes_through_the_other() -> None:
    flat, sizes = SE3(np.eye(3), np.zeros(3)), np.array([0.04, 0.04])
    upright = SE3.from_xyz_rpy(np.zeros(3), [math.pi / 2.0, 0.0, 0.0])
    # Of a tag of 40 mm; the back of the plate is 1.5 mm farther on the side of -y.
    for y, covered in ((0.0, True), (0.019, True), (0.021, True), (0.022, False), (-0.021, False)):
        poses = [flat, SE3(upright.R, np.array([0.0, y, 0.0]))]
        assert covered_tags(poses, sizes, 1.25)[0, 1] == covered, y
    above = [flat, SE3(flat.R, np.array([0.0, 0.0, -0.001]))]
    assert not covered_tags(above, sizes, 1.25).any()  # beside each other, or one in front of the other
