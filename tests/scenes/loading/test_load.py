"""Scene files: what is read, what is overridden, and what a mistake is answered with."""

import re
import struct
from pathlib import Path
from typing import Any

import pytest

from msrr_scenes import check_scene, load_scene, scene_hash
from msrr_scenes.checks.contradictions import contradictions
from msrr_scenes.checks.problems import Problem
from msrr_scenes.errors import MsrrError, SceneError, UnknownNameError
from msrr_scenes.geometry.unit_geometry import urdf_folder
from msrr_scenes.loading import load
from msrr_scenes.loading.load import read_document, shipped_scenes
from msrr_scenes.specs.control import ControlSpec
from msrr_scenes.specs.scene import Scene

GOOD = """\
description: two units, one camera each

units:
  b:
    number: 1
    pose: {x_m: 0.4}
  a:
    number: 0
    pose:
      frame: b.rear
      x_m: -0.70
      spread: {y_m: 0.10, yaw_deg: 20}

obstacles:
  post:
    shape: cylinder
    radius_m: 0.05
    pose: {y_m: 0.6}

plan:
  - {unit: a, to: b.rear}
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return path


def message(tmp_path: Path, text: str, **overrides: str) -> str:
    with pytest.raises(MsrrError) as caught:
        load_scene(write(tmp_path, text), {k.replace("__", "."): v for k, v in overrides.items()})
    return str(caught.value)


@pytest.mark.parametrize("name", shipped_scenes())
def test_every_shipped_scene_loads_and_says_what_it_is(name: str) -> None:
    scene = load_scene(name)
    assert scene.name == name
    assert len(scene.description) > 20
    check_scene(scene)  # and is good as a Python object as well


def test_scenes_with_units_in_another_order_are_two(tmp_path: Path) -> None:
    """Bodies are simulated, and units planned for, in that order: the results are others."""
    parts = re.findall(r"^  [ab]:\n(?:    .*\n)+", GOOD, re.MULTILINE)
    assert len(parts) == 2
    turned = GOOD.replace("".join(parts), "".join(reversed(parts)))
    assert turned != GOOD
    digests = [scene_hash(load_scene(write(tmp_path, text))) for text in (GOOD, GOOD, turned)]
    assert digests[0] == digests[1] != digests[2]


def test_a_shipped_scene_has_the_shipped_robot_wherever_it_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A changed copy in the working folder took its place in all shipped scenes, and nothing said so."""
    shipped = load_scene("close_range")
    before, track = scene_hash(shipped), shipped.geometry("a").track
    text = (urdf_folder() / "unit.urdf").read_text()
    wider = text.replace('"0 0.065 0.033"', '"0 0.075 0.033"').replace('"0 -0.065 0.033"', '"0 -0.075 0.033"')
    for name in ("unit.urdf", "mine.urdf"):
        (tmp_path / name).write_text(wider)
    monkeypatch.chdir(tmp_path)
    assert scene_hash(load_scene("close_range")) == before
    mine = load_scene("close_range", {"units.a.urdf": "mine.urdf"})
    assert mine.geometry("a").track == pytest.approx(track + 0.02)
    own = load_scene(write(tmp_path, GOOD))
    assert own.geometry("a").track == pytest.approx(track + 0.02), "beside a file of one's own it counts"


@pytest.mark.parametrize("name", ["hood.stl", "package://mine/hood.stl", "file://{folder}/hood.stl"])
def test_a_mesh_counts_by_what_it_holds_whatever_it_is_named_by(tmp_path: Path, name: str) -> None:
    """Else a sweep takes results of the old mesh from its store."""
    folder = tmp_path / "mine"
    folder.mkdir()
    hood = f'<visual><geometry><mesh filename="{name.format(folder=folder)}"/></geometry></visual></link>'
    text = (urdf_folder() / "unit.urdf").read_text()
    (folder / "mine.urdf").write_text(text.replace("</link>", hood, 1))
    mesh = folder / "hood.stl"
    digests = set()
    for z in (0.1, 0.2):
        mesh.write_bytes(bytes(80) + struct.pack("<I12fH", 1, 0, 0, 1, 0, 0, z, 1, 0, z, 0, 1, z, 0))
        digests.add(scene_hash(load_scene("close_range", {"units.a.urdf": str(folder / "mine.urdf")})))
    assert len(digests) == 2


@pytest.mark.parametrize("changed", ["hood.mtl", "skin.png", "bare.png"])
def test_the_looks_of_a_mesh_count_by_what_their_files_hold(tmp_path: Path, changed: str) -> None:
    """Cameras see the texture, so that a sweep with results of the old one would be of another robot."""
    face = "v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nf 1 2 3\n"
    (tmp_path / "hood.obj").write_text(f"mtllib hood.mtl\nusemtl skin\n{face}")
    (tmp_path / "hood.mtl").write_text("newmtl skin\nmap_Kd skin.png\n")
    (tmp_path / "bare.obj").write_text(face)
    for image in ("skin.png", "bare.png"):
        (tmp_path / image).write_bytes(b"grey")
    shapes = "".join(
        f'<visual><geometry><mesh filename="{mesh}.obj"/></geometry></visual>' for mesh in ("hood", "bare")
    )
    text = (urdf_folder() / "unit.urdf").read_text()
    (tmp_path / "mine.urdf").write_text(text.replace("</link>", f"{shapes}</link>", 1))
    scene = load_scene("close_range", {"units.a.urdf": str(tmp_path / "mine.urdf")})
    before = scene_hash(scene)
    file = tmp_path / changed
    file.write_bytes(file.read_bytes() + b"\n")
    assert scene_hash(scene) != before


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path, GOOD))
    assert scene.name == "scene"
    assert list(scene.units) == ["b", "a"]
    assert scene.units["a"].pose.x_m == -0.70
    assert scene.source == (tmp_path / "scene.yaml").resolve()


def test_the_issues_start_sets_and_limits() -> None:
    close, hard = load_scene("close_range"), load_scene("close_range_hard")
    spread = close.units["a"].pose.spread
    assert (close.units["a"].pose.x_m, spread.x_m, spread.y_m, spread.yaw_deg) == (-0.70, 0.05, 0.10, 20)
    spread = hard.units["a"].pose.spread
    assert (spread.x_m, spread.y_m, spread.yaw_deg) == (0.05, 0.15, 25)
    assert hard.limits.setting == "tight"
    assert hard.limits.w_max_radps == 1.0
    assert hard.cameras.onboard.latency_ms == 100
    retry = load_scene("close_range_forced_retry")
    assert retry.faults[0].kind == "port_plugged"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "      x_m: -0.70",
            "      xm: -0.70",
            ["scene.yaml:11:7: units.a.pose.xm: unknown key", "did you mean 'x_m'?"],
        ),
        ("      x_m: -0.70", "      x: -0.70", ["units.a.pose.x: unknown key; did you mean 'x_m'?"]),
        ("    number: 1\n", "", ["scene.yaml:4:3: units.b.number: required, and missing"]),
        ("number: 1", "number: 1\n    urdf: ''", ["units.b.urdf: expected a text of at least 1 character"]),
        (
            "shape: cylinder",
            "shape: cylindr",
            ["scene.yaml:16:5: obstacles.post.shape", "did you mean 'cylinder'?"],
        ),
        ("    shape: cylinder\n", "", ["obstacles.post.shape: required", "'cylinder' or 'box'"]),
        (
            "radius_m: 0.05",
            "radius_m: -1",
            ["scene.yaml:17:5: obstacles.post.radius_m", "greater than or equal to 0.005", "found -1"],
        ),
        (
            "    radius_m:",
            "    tag_m: 0.2\n    radius_m:",
            ["obstacles.post.tag_m: changes nothing without"],
        ),
        ("radius_m: 0.05", "radius_m: .nan", ["scene.yaml:17:5: obstacles.post.radius_m", "finite", "nan"]),
        ("radius_m: 0.05", "radius_m: .inf", ["scene.yaml:17:5: obstacles.post.radius_m", "finite", "inf"]),
        ("number: 1", "number: yes", ["scene.yaml:5:5: units.b.number", "the flag true; yes, no, "]),
        ("number: 1", "number: 1\n    tag_sizes_m: {tag_top: yes}", ["units.b.tag_sizes_m", "the flag true"]),
        ("number: 1", "number: two", ["scene.yaml:5:5: units.b.number", "expected an integer, found 'two'"]),
        (
            "frame: b.rear",
            "frame: rear",
            ["scene.yaml:10:7: units.a.pose.frame", "'<unit>.<port>'"],
        ),
        ("  a:\n", "  A:\n", ["scene.yaml:7:3: units.A", "lower-case"]),
        ("  a:\n", "  b:\n", ["scene.yaml:7:3: units.b: this key is already given at", "scene.yaml:4"]),
        (
            "- {unit: a, to: b.rear}",
            "- [a, b]",
            ["scene.yaml:21:5: plan.0: expected keys with values, found a list"],
        ),
        ("plan:", "as_built: carefull\nplan:", ["scene.yaml:20:1: as_built: ", "did you mean 'careful'?"]),
        ("plan:", "shape: cross\nplan:", ["scene.yaml:20:1: shape: ", "found 'cross'"]),
        (
            "plan:",
            "shape: {tree: {p: root, q: p}}\nplan:",
            ["shape.tree.q: expected 'root' or '<place>.<port>', found 'p'"],
        ),
        ("plan:", "assembled: [c-b.rear]\nplan:", ["assembled.0: expected '<unit>.<port>', found 'c'"]),
        (
            "plan:",
            "as_built: {drive: {track_percent: 5 %}}\nplan:",
            ["drive.track_percent: expected a number, or the keys sigma and error, found '5 %'"],
        ),
        ("plan:", "control: {docking: ''}\nplan:", ["scene.yaml:20:11: control.docking: "]),
        ("plan:", "plam:", ["scene.yaml:20:1: plam: unknown key; did you mean 'plan'?"]),
        (
            "plan:",
            "dropout: 0.1\nplan:",
            ["dropout: unknown key; it belongs below cameras.onboard, ", " or "],
        ),
        ("plan:", "grade: rough\nplan:", ["grade: unknown key; it belongs below as_built."]),
        ("plan:", "camera: {}\nplan:", ["scene.yaml:20:1: camera: unknown key; did you mean 'cameras'?"]),
        ("plan:", "control: {time_limit_s: 3}\nplan:", ["time_limit_s: unknown key; it belongs at the top"]),
        (
            "plan:",
            "cameras: {shape: cross}\nplan:",
            ["cameras.shape: unknown key; it belongs at the top of the file, or below obstacles.*."],
        ),
        (
            "shape: cylinder",
            "shape: cylinder\n    length_m: 1",
            ["key of entries that have shape: box, and not of those that have shape: cylinder. Keys here: "],
        ),
        (
            "{unit: a, to: b.rear}",
            "{undock: a, to: b.rear}",
            ["plan.0.to: unknown key; it is a key of entries that have unit and to, and not of"],
        ),
        (
            "number: 1",
            "number:1: 2",
            ["unknown key; a space is missing behind the colon, as in `number: 1`."],
        ),
        (
            "description: two units",
            "plant:unicycle\n\ndescription: two units",
            ["scene.yaml:1:1: not valid YAML: a space is missing behind the colon, as in `plant: unicycle`"],
        ),
        (
            "plan:",
            "radio: true\nplan:",
            ["radio: expected keys with values, found the flag true; write {}"],
        ),
        ("plan:", "control: {guard: no}\nplan:", ["found the flag false; write {enabled: false}"]),
        (
            "plan:",
            "assembled: a.front-b.rear\nplan:",
            ["expected a list, found 'a.front-b.rear'; a list of one"],
        ),
        ("plan:", "limits: tight\nplan:", ["limits: expected keys with values, found 'tight'. Keys here: "]),
        ("{x_m: 0.4}", "{x_m: 0,4}", ["scene.yaml:6", "pose.4: unknown key; a decimal fraction has a point"]),
        ("radius_m: 0.05", "radius_m: 0,05", ["found '0,05'; a decimal fraction has a point"]),
        ("plan:", "arena: {x_m: [-1,5, 1,5]}\nplan:", ["at most 2 entries, found 4; a decimal fraction"]),
        ("plan:", "plan: {", ["scene.yaml:21:3: not valid YAML: a value is expected here"]),
        (
            "{x_m: 0.4}",
            "{x_m: 0.4",
            ["not valid YAML: expected ',' or '}' for the bracket that opens in line 6, column 11"],
        ),
        ("b.rear}", "b.rear", ["scene.yaml:21:5: not valid YAML: this is never closed"]),
        ("two units", '"two units', ["scene.yaml:1:14: not valid YAML: this is never closed"]),
        ("plan:", "plan", ["scene.yaml:20:1: not valid YAML: a line that is neither `key: value` nor"]),
        ("  a:", " a:", ["scene.yaml:7:2: not valid YAML: this does not go with what stands before it"]),
        ("number: 1", "number: 1: 2", ["scene.yaml:5:14: not valid YAML: no key is expected here; check"]),
        ("plan:", "---\nplan:", ["scene.yaml:20:1: not valid YAML: a second document begins here"]),
        ("two units", "@ two units", ["scene.yaml:1:14: ", "has to be in quotes"]),
        ("two units", "\0", ["scene.yaml:1:14: ", "U+0000 is not allowed; save the file as UTF-8"]),
        ("    number: 1", "\tnumber: 1", ["scene.yaml:5:1: not valid YAML: a tab; indent with spaces"]),
        ("{x_m: 0.4}", "{x_m: !!python/name:os.system }", ["scene.yaml:6", "not allowed"]),
        ("{x_m: 0.4}", "{<<: {x_m: 0.4}}", ["scene.yaml:6", "merge keys"]),
        ("{x_m: 0.4}", "{[1]: 0.4}", ["scene.yaml:6", "plain word"]),
        ("{x_m: 0.4}", "&p {x_m: *p}", ["scene.yaml:6", "levels after aliases"]),
        (
            "description: two units",
            "source: /etc/passwd\ndescription: two units",
            ["scene.yaml:1:1: source: unknown key"],
        ),
    ],
)
def test_a_mistake_names_file_line_column_key_and_mend(
    tmp_path: Path, old: str, new: str, expected: list[str]
) -> None:
    assert old in GOOD
    text = message(tmp_path, GOOD.replace(old, new, 1))
    for part in expected:
        assert part in text
    assert "pydantic" not in text


def test_several_mistakes_come_in_one_message(tmp_path: Path) -> None:
    text = message(tmp_path, GOOD.replace("radius_m: 0.05", "radius_m: x").replace("number: 0", "number: -3"))
    assert "units.a.number" in text
    assert "obstacles.post.radius_m" in text


def test_a_flood_of_mistakes_is_cut_short(tmp_path: Path) -> None:
    text = message(tmp_path, GOOD + "".join(f"key_{i}: 1\n" for i in range(40)))
    assert "... and 32 more" in text


@pytest.mark.parametrize(
    "text", ["", "- a\n", "just words", "a: \x00", "a: [1, 2", "\t- a", "%YAML 9", "a: " + "[" * 500]
)
def test_what_is_not_a_scene_at_all(tmp_path: Path, text: str) -> None:
    assert "scene.yaml" in message(tmp_path, text)


def test_a_bomb_of_aliases_is_refused_quickly(tmp_path: Path) -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    assert "aliases" in message(tmp_path, "\n".join(lines))


def test_other_ways_not_to_be_a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SceneError, match=r"not UTF-8 .*; save the file as UTF-8"):
        load_scene(tmp_path / "binary.yaml")
    with pytest.raises(SceneError, match="no such scene file"):
        load_scene(tmp_path / "missing.yaml")
    with pytest.raises(SceneError, match="a folder; name a scene file in it"):
        load_scene(tmp_path)
    with pytest.raises(SceneError, match="more than"):
        load_scene(write(tmp_path, "# " + "x" * 1_000_001))
    with pytest.raises(UnknownNameError, match="did you mean 'close_range'"):
        load_scene("close_rnge")
    monkeypatch.chdir(tmp_path)
    write(tmp_path, GOOD)
    with pytest.raises(UnknownNameError, match=r"named by its path, such as scene\.yaml\."):
        load_scene("scene")
    (tmp_path / "scene.yaml").rename("scene")  # without an ending it is no other file
    assert load_scene("scene").name == "scene"
    for name in ("x" * 5000, f"{'x' * 5000}.yaml"):
        with pytest.raises((UnknownNameError, SceneError), match=r"unknown scene|File name too long"):
            load_scene(name)
    with pytest.raises(SceneError, match=r"calibration: 'x+' cannot be read: File name too long"):
        load_scene("close_range", {"cameras.onboard.calibration": "x" * 5000})


@pytest.mark.parametrize(
    "name", ["../../x", "a/b", "/tmp/x", "..", ".hidden", "-x", "a b", "a[/]", "", "a" * 65, "\\ud800", "\\0"]
)
def test_a_name_is_a_name(tmp_path: Path, name: str) -> None:
    text = message(tmp_path, f'name: "{name}"\n{GOOD}')
    assert "scene.yaml:1:" in text
    assert "a plain name" in text or "half a character" in text


def test_a_scene_without_a_name_is_named_like_its_file(tmp_path: Path) -> None:
    for stem, name in [("two.units-3", "two.units-3"), ("my scène [1]", "my_sc_ne__1_"), (".x", "_x")]:
        (tmp_path / f"{stem}.yaml").write_text(GOOD)
        assert load_scene(tmp_path / f"{stem}.yaml").name == name


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("number: 1", f"number: {'9' * 4300}", "5:13: a number of more than 40 characters"),
        ("x_m: 0.4", f"x_m: 0.{'4' * 100}", "6:17: a number of more than 40 characters"),
        (
            "number: 1",
            f"number: 1\n    urdf: {'u' * 5000}",
            "6:5: units.b.urdf: expected a text of at most 255",
        ),
        ("number: 1", f"number: 1\n    {'k' * 200}: 1", "6:5: a key of more than 100 characters"),
        ("x_m: 0.4", "x_m: 1e15", "less than or equal to 100"),
        ("x_m: 0.4", 'frame: "\\ud800"', "U+D800 is half a character"),
        ("two units", "x" * 5000, "description: expected a text of at most 4000"),
    ],
)
def test_numbers_and_texts_are_bounded_in_length(tmp_path: Path, old: str, new: str, expected: str) -> None:
    text = message(tmp_path, GOOD.replace(old, new, 1))
    assert expected in text
    assert len(text) < 1000


def test_an_endless_file_is_refused() -> None:
    with pytest.raises(SceneError, match="/dev/zero: a file of more than 1000000 characters is refused"):
        read_document(Path("/dev/zero"))


@pytest.mark.parametrize("overrides", [None, ["seed=3"], {3: 4}, "plant=unicycle"])
def test_overrides_that_are_no_dict_of_keys_are_refused(overrides: Any) -> None:
    with pytest.raises(SceneError, match="close_range: expected overrides as a dict of dotted keys, found"):
        load_scene("close_range", overrides)


@pytest.mark.parametrize(
    "value", ['!!int ""', '!!float "_"', "!!int _", pytest.param(10**5000, id="5001 digits")]
)
def test_numbers_without_digits_or_with_too_many_are_refused(value: object) -> None:
    with pytest.raises(SceneError, match="time_limit_s"):
        load_scene("close_range", {"time_limit_s": value})


def test_an_override_that_changes_nothing_is_refused(tmp_path: Path) -> None:
    """A sweep over the noise of the images found that noise does not matter to perception without images."""
    blind = {"plant": "unicycle", "perception": "parametric"}
    noise, sigma = {"cameras.onboard.noise_grey": "8"}, {"parametric.sigma_xy_m": "0.02"}
    of_pixels = {"cameras.overhead.localisation.bias_x_m": "0.1", "control.detector": "aruco"}
    of_pixels |= {"cameras.onboard.exposure_ms": "5", "cameras.overhead.renderer": "tiny"}
    for key, value in (noise | of_pixels).items():
        with pytest.raises(SceneError, match=f"{key}: changes nothing with perception: parametric"):
            load_scene("two_units", {**blind, key: value})
    for overrides, why in (
        (sigma, "with perception: images"),
        ({"motors.torque_nm": "0.2", **blind}, "with plant: unicycle"),
        ({"control.guard": "{sigmas: 3}"}, "without an overhead camera"),
        ({"docking.learn_seats": "false"}, "without a base station"),
        ({"cameras.onboard.samples": "4"}, "with the renderer raster"),
        ({"cameras.overhead.readout": "frames"}, "but the time that a trial takes"),
    ):
        with pytest.raises(SceneError, match=f": {next(iter(overrides))}: changes nothing {why}"):
            load_scene("close_range", overrides)
    for key, value in {"control.docking": "c1", "docking.attempts": "1"}.items():
        with pytest.raises(SceneError, match=f"{key}: changes nothing in a plan in which no unit docks"):
            load_scene("corridor", {key: value})
    load_scene("close_range", noise)
    load_scene("close_range", {**blind, **sigma, "cameras.onboard.dropout": "0.1"})
    file = tmp_path / "both.yaml"  # what a file says may be for either perception
    file.write_text(GOOD + "parametric: {sigma_xy_m: 0.02}\n", encoding="utf-8")
    load_scene(file)


def test_overrides_reach_everything(tmp_path: Path) -> None:
    overrides = {
        "cameras.onboard.noise_grey": "8",
        "cameras.overhead": "{height_m: 2.5}",
        "plan.0.to": "b.rear",
        "limits.setting": "tight",
        "units.a.pose.spread.x_m": "0.01",
        "faults": "[{kind: marker_hidden, unit: b}]",
        "control.docking.params.gain": "1e-2",
        "control.detector": "my.module:Detector",
        "plant": "unicycle",
    }
    scene = load_scene(write(tmp_path, GOOD), overrides)
    assert scene.cameras.onboard.noise_grey == 8.0
    assert scene.cameras.overhead is not None
    assert scene.cameras.overhead.height_m == 2.5
    assert scene.limits.v_max_mps == 0.35
    assert scene.units["a"].pose.spread.x_m == 0.01
    assert scene.units["a"].pose.spread.y_m == 0.10  # beside it, untouched
    assert scene.faults[0].kind == "marker_hidden"
    assert scene.control.docking.name == ControlSpec().docking.name  # the default keeps its name
    assert scene.control.detector.name == "my.module:Detector"  # a name alone is a choice
    assert scene.plant == "unicycle"


def test_overrides_reach_below_a_grade_that_is_given_by_its_name_alone(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD + "\nas_built: workshop\n")
    built = load_scene(path, {"as_built.onboard.yaw_deg": "2"}).as_built
    assert str(built) == "workshop but for onboard.yaw_deg = 2"
    built = load_scene(path, {"as_built": "perfect", "as_built.onboard.yaw_deg": "2"}).as_built
    assert str(built) == "perfect but for onboard.yaw_deg = 2"
    path.write_text(GOOD + "\nas_built: workshp\n")
    with pytest.raises(SceneError, match=r"scene.yaml:\d+:1: as_built.grade: .*workshop"):
        load_scene(path, {"as_built.onboard.yaw_deg": "2"})


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("cameras.onboard.nois_grey", "8", "did you mean 'noise_grey'?"),
        ("plan.3.unit", "a", "expected an index (0 .. 0), found '3'"),
        ("plan.first.unit", "a", "is a list; expected an index"),
        ("plan.0.unit.name", "a", "plan.0.unit is a plain value and has no key 'name'"),
        ("limits.setting", "fast", "expected 'normal' or 'tight'"),
        ("as_built", "carefull", "as_built: expected 'perfect', 'careful', 'workshop' or 'rough'"),
        ("cameras", "[", "not valid YAML"),
        ("cameras..onboard", "1", "expected a dotted key"),
        ("units.a.number", "1", "has the number 1 already; 0 is free"),
        (
            "units.z.number",
            "3",
            "there is no unit 'z'. Units here: b, a. A new one is given as a whole, units.z={",
        ),
        (
            "obstacles.pots.radius_m",
            "1",
            "no obstacle 'pots'; did you mean 'post'? Obstacles here: post. A new",
        ),
        ("los.half_width_m", "0.2", "too wide for the cone"),
    ],
)
def test_a_bad_override_is_named_as_such(tmp_path: Path, key: str, value: str, expected: str) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene(write(tmp_path, GOOD), {key: value})
    assert f"override {key}={value}" in str(caught.value)
    assert expected in str(caught.value)


def test_an_override_takes_no_earlier_one_back(tmp_path: Path) -> None:
    """A parameter that was set before its law was lost without a word."""
    path, name, key = write(tmp_path, GOOD), "control.docking", "control.docking.params.alpha"
    scene = load_scene(path, {name: "c1", key: "0.3"})
    assert (scene.control.docking.name, scene.control.docking.params) == ("c1", {"alpha": 0.3})
    with pytest.raises(SceneError, match=f"would take back override {key}; give {name} before {key}"):
        load_scene(path, {key: "0.3", name: "c1"})


def test_the_hash_is_of_what_changes_a_trial(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    base = scene_hash(load_scene(path))
    assert scene_hash(load_scene(path)) == base
    assert scene_hash(load_scene(path, {"description": "other words"})) == base
    assert scene_hash(load_scene(path, {"docking.attempts": "3"})) == base  # the default, written out
    assert scene_hash(load_scene(path, {"docking.attempts": "2"})) != base
    moved = tmp_path / "elsewhere" / "scene.yaml"
    moved.parent.mkdir()
    moved.write_text(GOOD)
    assert scene_hash(load_scene(moved)) == base


def test_the_hash_follows_the_urdf(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    base = scene_hash(load_scene(path))
    urdf = (urdf_folder() / "unit.urdf").read_text()
    (tmp_path / "unit.urdf").write_text(urdf.replace('<mass value="2"/>', '<mass value="3"/>'))
    assert scene_hash(load_scene(path)) != base


def test_a_scene_is_checked_again_only_after_a_file_of_it_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    urdf = tmp_path / "unit.urdf"
    urdf.write_text((urdf_folder() / "unit.urdf").read_text())
    scene = load_scene(write(tmp_path, GOOD))
    looked: list[Scene] = []

    def looks(found: Scene) -> list[Problem]:
        looked.append(found)
        return contradictions(found)

    monkeypatch.setattr(load, "contradictions", looks)
    check_scene(scene)
    check_scene(scene.model_copy(update={"description": "the same in other words"}))
    assert not looked
    lower = scene.model_copy(update={"time_limit_s": 0.5 * scene.time_limit_s})
    check_scene(lower)
    assert looked == [lower]
    urdf.write_text(urdf.read_text().replace("<link", "<lnk"))
    with pytest.raises(MsrrError, match="not well-formed XML"):
        check_scene(scene)
    assert looked == [lower, scene]


def test_a_plugin_of_another_simulator_in_a_urdf_is_no_file_of_the_scene(tmp_path: Path) -> None:
    path, urdf = write(tmp_path, GOOD), (urdf_folder() / "unit.urdf").read_text()
    plugin = '<gazebo><plugin name="drive" filename="package://drives/libdrive.so"/></gazebo>'
    (tmp_path / "unit.urdf").write_text(urdf.replace("</robot>", f"{plugin}</robot>"))
    assert scene_hash(load_scene(path))


def test_the_reference_shows_every_shipped_scene() -> None:
    page = (Path(__file__).parents[3] / "docs" / "reference" / "scenes.md").read_text()
    for name in shipped_scenes():
        assert f"| `{name}` |" in page
