"""The check of a scene: what a trial could not be built of is refused before anything is run."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.run import run_trial
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.trial.check import check_trial
from msrr_scenes.errors import MsrrError, ProgramFailedError, SceneError
from msrr_scenes.geometry.unit_geometry import urdf_folder
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene

Load = Callable[..., Scene]


@pytest.mark.parametrize(
    ("name", "overrides", "says"),
    [
        ("close_range", {"control.docking": "c3"}, "control.docking: unknown controller 'c3'"),
        ("close_range", {"control.docking": "no.such:Law"}, "No module named 'no'"),
        (
            "close_range",
            {"control.docking": "math:pi"},
            "docking: controller 'math:pi' is not a class",
        ),
        ("close_range", {"control.docking.params.k_n": "1"}, "params.k_n: controller 'cbf': unknown param"),
        ("close_range", {"control.docking.params.k_n_per_s": "-1"}, "k_n_per_s: controller 'cbf': Input"),
        (
            "close_range",
            {"control.docking.params.margin_deg": "80"},
            "margin_deg: controller 'cbf': 80",
        ),
        ("close_range", {"control.estimator": "ekf"}, "control.estimator: unknown estimator 'ekf'"),
        ("assemble_line", {"control.docking": "c3"}, "control.docking: unknown controller 'c3'"),
        ("assemble_line", {"control.estimator.params.start_inflation": "{far: 3}"}, "start_inflation"),
        ("close_range", {"control.estimator.params.slip": "0"}, "has to be a number from 1e-06 to 1"),
        ("close_range", {"control.estimator.params.slop": "1"}, "estimator 'corner_ekf' does not take"),
        ("close_range", {"control.detector": "pupl"}, "did you mean 'pupil'?"),
        (
            "close_range",
            {"control.detector.params.quad_decimate": "1e300"},
            "quad_decimate: detector 'pupil': has to be a number",
        ),
        (
            "close_range",
            {"control.detector.params.max_hamming": ".nan"},
            "max_hamming: detector 'pupil': has to be a number from 0",
        ),
        ("close_range", {"control.detector.params.family": "tag99"}, "unknown tag family 'tag99'"),
        ("close_range", {"cameras.onboard.renderer": "rasta"}, "unknown renderer 'rasta'"),
        ("two_units", {"control.assembly": "c9"}, "unknown assembler 'c9'"),
        (
            "two_units",
            {"control.assembly": "{name: c2, params: {feedback: {k: 1}}}"},
            "params.feedback.k: assembler 'c2': unknown parameter",
        ),
        (
            "two_units",
            {"control.assembly.params.pace.cruise_mps": "0.39"},
            "0.39 leaves nothing to catch",
        ),
        ("two_units", {"control.assembly.params.route.handover_m": "3.5"}, "lies outside the arena"),
        ("three_units", {"time_limit_s": "28"}, "time_limit_s: the steps take at least"),
    ],
)
def test_what_a_trial_could_not_be_built_of_is_refused_with_its_place(
    name: str, overrides: Mapping[str, str], says: str, shipped: Load
) -> None:
    of_pixels = ("control.detector", "cameras.onboard.renderer")
    scene = shipped(name, overrides, blind=not any(key.startswith(of_pixels) for key in overrides))
    with pytest.raises(SceneError) as caught:
        check_trial(scene)
    assert says in str(caught.value)
    (key, value), *_ = overrides.items()
    of_file = rf"\S*/{name}\.yaml:\d+:\d+: plan\.0: "
    assert re.match(rf"override {re.escape(f'{key}={value}: {key}')}|{of_file}", str(caught.value))


CHOICES = """units:
  a: {number: 0, pose: {x_m: -0.7, frame: b.rear}}
  b: {number: 1}
as_built: perfect
cameras:
  onboard:
    renderer:
      name: tiny
      params: {floor: composited}
  overhead:
    renderer: raster
plan: [{unit: a, to: b.rear}]
control:
  assembly:
    params: {widest_obstacle_m: 1.0}
  docking: {name: c2, params: {feedback:
    {k_per_s: 4.0}}}
  estimator:
    params:
      slip: 0.1
  detector: pupil
"""


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("composited", "wood", "9:16: cameras.onboard.renderer.params.floor: renderer 'tiny': has to be"),
        ("floor: ", "flor: ", "9:16: cameras.onboard.renderer.params.flor: renderer 'tiny' does not take"),
        ("name: tiny", "name: own", "7:5: cameras.onboard.renderer: unknown renderer 'own'"),
        ("raster", "rasta", "11:5: cameras.overhead.renderer: unknown renderer 'rasta'"),
        ("  assembly:", "  assembly:\n    name: c9", "14:3: control.assembly: unknown assembler 'c9'"),
        ("_m: 1.0", "_m: wide", "15:14: control.assembly.params.widest_obstacle_m: assembler 'c1': Input"),
        ("name: c2", "name: c9", "16:3: control.docking: unknown controller 'c9'"),
        ("4.0", "oops", "17:6: control.docking.params.feedback.k_per_s: controller 'c2': Input should be"),
        ("slip: 0.1", "slip: x", "20:7: control.estimator.params.slip: estimator 'corner_ekf': has to be"),
        ("slip: ", "slop: ", "20:7: control.estimator.params.slop: estimator 'corner_ekf' does not take"),
        ("pupil", "math:pi", "21:3: control.detector: detector 'math:pi' is not a class"),
    ],
)
def test_the_place_of_a_wrong_choice_is_its_line(old: str, new: str, place: str, tmp_path: Path) -> None:
    """The file alone was named, and of two cameras neither."""
    path = tmp_path / "scene.yaml"
    path.write_text(CHOICES)
    load_scene(path)
    assert CHOICES.count(old) == 1
    path.write_text(CHOICES.replace(old, new))
    with pytest.raises(SceneError) as caught:
        check_trial(load_scene(path))
    assert str(caught.value).startswith(f"{path}:{place}")


SHAPES = """
arena: {x_m: [-1.0, 1.0], y_m: [-0.7, 0.7]}
units:
  a: {number: 0, pose: {x_m: -0.5, y_m: -0.3}}
  b: {number: 1, pose: {x_m: 0.5, y_m: -0.3}}
  c: {number: 2, pose: {x_m: -0.5, y_m: 0.3}}
  d: {number: 3, pose: {x_m: 0.5, y_m: 0.3}}
  e: {number: 4, pose: {x_m: 0.0, y_m: 0.3}}
  f: {number: 5, pose: {x_m: 0.0, y_m: -0.3}}
  g: {number: 6, pose: {x_m: 0.0, y_m: 0.0}}
cameras: {overhead: {height_m: 4.0}}
"""

#: Two places from opposite sides, each in the lane of the other one.
FACING = "{p0: root, p1: p0.right, p2: p0.left, p3: p1.right, p4: p2.left, p5: p3.rear, p6: p5.right}"


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        (
            "tree: {p: root, q: p.front}",
            "shape.tree: q: p.front is the active port and takes nobody; dock it",
        ),
        ("tree: {p: root, q: p.rear, r: p.rear}", "shape.tree: r: p.rear is taken by q; dock it to another"),
        (
            "tree: {p: root, q: p.left, r: p.rear, s: r.left}",
            "shape.tree: q and s would touch: units stand side by side only where a port joins",
        ),
        (f"tree: {FACING}", "shape.tree: p4 has to be built before p6 and closes its lane (a parent"),
        ("tree: {p: q.rear, q: p.rear}", "shape.tree: a shape needs exactly one root, found none; write"),
        ("tree: {p: root, q: z.rear}", "shape.tree: q: no place named 'z'."),
        ("tree: {middle: root, q: middel.rear}", "q: no place named 'middel'; did you mean 'middle'?"),
        ("tree: {p: root, q: r.rear, r: q.rear}", "shape.tree: not joined to the root 'p': q, r; dock each"),
        ("{named: true, tree: {a: root, z: a.rear}}", ":11:38: shape.tree.z: no unit named 'z'"),
        ("line: 8", ":11:9: shape.line: 8 places, but 7 units; add units"),
        ("line: 6", "shape.line: the shape and the lanes to it do not fit into the 2.00 m by 1.40 m"),
        ("[{zigzag: 2}, {line: 2}, {line: 3}]", "a line of 3 is not built from an assembly of 2 units"),
        (
            "[{line: 3}, {tree: {p: root, q: p.left, r: p.right}}]",
            "shape.1.tree: the shape and the lanes to it do not fit with its root where the shapes before it",
        ),
    ],
)
def test_a_shape_that_cannot_be_built_is_refused_with_key_reason_and_mend(
    shape: str, says: str, tmp_path: Path
) -> None:
    path = tmp_path / "shape.yaml"
    path.write_text(f"{SHAPES.strip()}\nshape: {shape if shape[0] in '{[' else '{' + shape + '}'}\n".lstrip())
    with pytest.raises(SceneError) as caught:
        check_trial(load_scene(path, {"plant": "unicycle", "perception": "parametric"}))
    assert says in str(caught.value)
    assert "shape.yaml" in str(caught.value)


@pytest.mark.parametrize(
    ("x_m", "says"), [(0.85, ""), (0.95, "plan.0.pose: (0.95, 0) does not lie 0.1 m inside")]
)
def test_a_place_at_which_no_route_can_end_is_refused(x_m: float, says: str, tmp_path: Path) -> None:
    path = tmp_path / "move.yaml"
    path.write_text(f"{SHAPES.strip()}\nplan: [{{move: a, pose: {{x_m: {x_m}}}}}]\n")
    scene = load_scene(path, {"plant": "unicycle", "perception": "parametric"})
    if not says:
        check_trial(scene)
        return
    with pytest.raises(SceneError, match=re.escape(says)):
        check_trial(scene)


CHAIN = "b.front-a.rear, c.front-b.rear"


@pytest.mark.parametrize(
    ("assembled", "task", "says"),
    [
        (CHAIN, "shape: {named: true, tree: {a: root, b: a.left, c: a.rear}}", ""),
        (
            CHAIN,
            "shape: {named: true, tree: {b: root, a: b.left, c: b.rear}}",
            "'b' is to be the root of the shape, and the root of the assembly that it is built from is",
        ),
        (
            CHAIN,
            "shape: {named: true, tree: {a: root, b: a.left, d: a.rear}}",
            "the places d are named by no unit of the assembly that the shape is built from; name them c",
        ),
        (
            CHAIN,
            "shape: [{tee: 4}, {line: 4}]",
            "a tee of 4 is not built from an assembly of 3 units: the numbers differ",
        ),
        (
            CHAIN,
            "shape: [{line: 3}, {named: true, tree: {b: root, a: b.left, c: b.rear}}]",
            "'b' is to be the root of the shape, and the root of the assembly that it is built from is",
        ),
        (
            "",
            "shape: [{line: 3}, {named: true, tree: {b: root, a: b.left, c: b.rear}}]",
            "a tree of 3 with named places is built from a shape whose places anybody takes, also that",
        ),
        (
            "b.front-a.rear, d.front-c.rear",
            "shape: {line: 4}",
            "exactly one root, found a, c; a shape is built from one assembly, so lock all",
        ),
        ("b.front-a.rear, d.front-c.rear", "plan: [{undock: b, name: out}, {unit: b, to: c.right}]", ""),
    ],
)
def test_a_shape_is_built_from_one_assembly_by_those_who_are_in_it(
    assembled: str, task: str, says: str, tmp_path: Path
) -> None:
    """Such a trial ended as incomplete, at once or with its second shape, for a reason that was another one.

    A plan that leads from one assembly to another was refused, as if it were a shape.
    """
    poses = {u: f"{{x_m: 0.5, y_m: {0.8 * k - 1.0:g}}}" for k, u in enumerate("abcd")}
    free = {u: pose for u, pose in poses.items() if f"{u}.front-" not in assembled}
    units = [f"{u}: {{number: {k}, pose: {free.get(u, '{}')}}}" for k, u in enumerate("abcd")]
    path = tmp_path / "chain.yaml"
    path.write_text(
        f"{{arena: {{y_m: [-2.7, 2.7]}}, cameras: {{overhead: {{height_m: 6.5}}}}, "
        f"units: {{{', '.join(units)}}}, assembled: [{assembled}], {task}}}\n"
    )
    scene = load_scene(path, {"plant": "unicycle", "perception": "parametric"})
    if not says:
        check_trial(scene)
        return
    with pytest.raises(SceneError) as caught:
        check_trial(scene)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("shape", "key"),
    [
        ("{line: 3}", ""),
        ("[{line: 3}, {tree: {p: root, q: p.right, r: q.rear}}]", "shape.1.tree"),
        ("{named: true, tree: {a: root, b: a.rear, c: a.right}}", "shape.tree"),
    ],
)
def test_a_shape_is_refused_that_does_not_fit_around_the_root_of_an_assembly(
    shape: str, key: str, tmp_path: Path
) -> None:
    """The root stays where it is, near the wall at its right: the mission ended before it had begun."""
    path, blind = tmp_path / "chain.yaml", {"plant": "unicycle", "perception": "parametric"}
    path.write_text(
        "{arena: {x_m: [-1.5, 1.5], y_m: [-1.8, 1.8]}, cameras: {overhead: {height_m: 5.0}}, "
        "units: {a: {number: 0, pose: {x_m: 0.9, y_m: -0.9}}, b: {number: 1}, c: {number: 2}}, "
        f"assembled: [{CHAIN}], shape: {shape}}}\n"
    )
    if key:
        with pytest.raises(SceneError) as caught:
            check_trial(load_scene(path, blind))
        assert f": {key}: the shape and the lanes to it do not fit" in str(caught.value)
        assert "move units.a.pose, enlarge the arena, or raise cameras" in str(caught.value)
    check_trial(load_scene(path, {**blind, **({"units.a.pose.y_m": "0"} if key else {})}))


@pytest.mark.parametrize(
    ("plan", "key"),
    [
        ("{unit: d, to: a.right}", "plan.0.to"),
        ("{undock: c}, {unit: d, to: b.right, after: []}", "plan.1.to"),
        ("{unit: d, to: a.left}", ""),
        ("{undock: c}, {undock: b}, {unit: d, to: a.right}", ""),
    ],
)
def test_a_port_that_faces_the_border_is_refused_unless_its_unit_can_drive_by_then(
    plan: str, key: str, tmp_path: Path
) -> None:
    """The wall is 0.6 m to the right; the mission ended as incomplete, a minute or so later."""
    path, blind = tmp_path / "chain.yaml", {"plant": "unicycle", "perception": "parametric"}
    path.write_text(
        "{arena: {x_m: [-2.5, 1.5], y_m: [-1.8, 1.8]}, cameras: {overhead: {height_m: 5.0}}, radio: {}, "
        "units: {a: {number: 0, pose: {x_m: 0.9, y_m: -1.2}}, b: {number: 1}, c: {number: 2}, "
        f"d: {{number: 3, pose: {{x_m: -1, y_m: 1}}}}}}, assembled: [{CHAIN}], plan: [{plan}]}}\n"
    )
    if key:
        with pytest.raises(SceneError) as caught:
            check_trial(load_scene(path, blind))
        assert f": {key}: " in str(caught.value)
        assert "faces the border of what the overhead camera sees" in str(caught.value)
    check_trial(load_scene(path, {**blind, **({"units.a.pose.y_m": "0"} if key else {})}))


def test_a_shape_is_refused_where_the_overhead_camera_sees_too_little_of_the_arena(tmp_path: Path) -> None:
    """The same arena fits a line of three under a camera that sees all of it."""
    path, found = tmp_path / "shape.yaml", []
    text = SHAPES.replace("[-1.0, 1.0]", "[-2.0, 2.0]").replace("[-0.7, 0.7]", "[-1.5, 1.5]")
    path.write_text(f"{text}shape: {{line: 6}}\n")
    for height_m in ("4.0", "1.7"):
        blind = {"plant": "unicycle", "perception": "parametric", "cameras.overhead.height_m": height_m}
        try:
            check_trial(load_scene(path, blind))
            found.append("")
        except SceneError as error:
            found.append(str(error))
    assert found[0] == ""
    assert "do not fit" in found[1]
    assert "cameras.overhead.height_m" in found[1]


def test_dock_sweep_and_check_refuse_alike(
    shipped: Load, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # for the store of sweeps
    scene = shipped("close_range", {"control.docking": "c3"}, blind=True)
    found = set()
    for refusing in (check_trial, run_trial, lambda scene: run_sweep(scene, [1, 2])):
        with pytest.raises(MsrrError) as caught:
            refusing(scene)
        found.add(str(caught.value))
    assert len(found) == 1
    options = ["--set", "control.docking=c3", "--set", "plant=unicycle", "--set", "perception=parametric"]
    for command in ("check", "dock", "sweep"):
        assert run([command, "close_range", *options]) == 2
        told = found.copy().pop().removeprefix("override")
        assert f"msrr: --set{told}" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["check", "dock", "sweep", "tolerance"])
def test_a_set_value_that_contradicts_the_scene_is_named(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line of the file that is named does not hold it."""
    assert run([command, "close_range", "--set", "units.a.pose.x_m=-70"]) == 2
    assert "msrr: with --set units.a.pose.x_m=-70: " in capsys.readouterr().err


@pytest.mark.parametrize("name", ["close_range", "four_units_tee"])
def test_with_contact_and_pixels_a_good_scene_is_accepted(name: str) -> None:
    check_trial(load_scene(name))


def test_plans_that_fit_the_time_are_accepted(shipped: Load) -> None:
    """Three_units takes 34 s and more without contact; a plan of one step may be cut short on purpose."""
    check_trial(shipped("three_units", {"time_limit_s": "34"}, blind=True))
    check_trial(shipped("close_range", {"time_limit_s": "0.1"}, blind=True))


URDF = (urdf_folder() / "unit.urdf").read_text()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "port_rear_marker_left",
            "port_rear_marker_lefty",
            "lacks the link(s) port_rear_marker_left; did you mean",
        ),
        ("port_rear_marker_", "port_rear_marked_", "no tag; did you mean 'port_rear_marked_left'?"),
        (
            '"pin_left"',
            '"pn_left"',
            "units.a: odd.urdf has no link 'pin_left', and a.front to b.rear by contact needs it. A link of "
            "another name is mapped by units.a.frames: {pin_left: <link>}",
        ),
    ],
)
def test_a_renamed_link_is_named(tmp_path: Path, old: str, new: str, says: str) -> None:
    """A renamed marker link was answered with: port 'rear' has no holes; passive ports: rear ..."""
    assert old in URDF
    (tmp_path / "odd.urdf").write_text(URDF.replace(old, new))
    text = (
        (Path(str(load_scene("close_range").source)))
        .read_text()
        .replace("number: 1", "number: 1\n    urdf: odd.urdf")
    )
    (tmp_path / "scene.yaml").write_text(text.replace("number: 0", "number: 0\n    urdf: odd.urdf"))
    with pytest.raises(SceneError) as caught:
        check_trial(load_scene(tmp_path / "scene.yaml"))
    assert says in str(caught.value)
    assert "scene.yaml" in str(caught.value)


FAILING = """
class Broken:
    def __init__(self, setup):
        raise RuntimeError("not today")
    def reset(self, inputs): ...
    def step(self, inputs): ...
"""


def test_a_class_that_fails_is_refused_by_check_and_an_outcome_of_dock(
    shipped: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_when_built.py").write_text(FAILING)
    monkeypatch.syspath_prepend(str(tmp_path))
    scene = shipped("close_range", {"control.docking": "broken_when_built:Broken"}, blind=True)
    with pytest.raises(
        ProgramFailedError, match=r"broken_when_built\.py line 4: __init__ raised RuntimeError"
    ):
        check_trial(scene)
    assert run_trial(scene, 1).outcome.value == "program_failed"


def test_a_mesh_that_the_cameras_could_not_draw_is_refused(tmp_path: Path) -> None:
    """The check accepted it, and the first picture of a trial did not."""
    (tmp_path / "hood.obj").write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\n")
    hood = '<visual><geometry><mesh filename="hood.obj"/></geometry></visual></link>'
    text = (urdf_folder() / "unit.urdf").read_text()
    (tmp_path / "mine.urdf").write_text(text.replace("</link>", hood, 1))
    own = {"units.a.urdf": str(tmp_path / "mine.urdf"), "cameras.overhead": "null"}
    scene = load_scene("close_range", own)
    with pytest.raises(SceneError, match=r"hood\.obj: malformed mesh: no faces"):
        check_trial(scene)


def test_pybullet_takes_127_joints_of_a_robot(tmp_path: Path) -> None:
    """Two wheels, two casters and two pins of the round robot are joints that stay."""
    drawn = (urdf_folder() / "round.urdf").read_text()

    def robot(kind: str, count: int) -> Mapping[str, str]:
        more = "".join(
            f'<link name="x{i}"><inertial><mass value="1e-3"/><inertia ixx="1e-6" iyy="1e-6" izz="1e-6"/>'
            f'</inertial></link><joint name="j{i}" type="{kind}"><parent link="base_link"/>'
            f'<child link="x{i}"/></joint>'
            for i in range(count)
        )
        path = tmp_path / f"{kind}{count}.urdf"
        path.write_text(drawn.replace("</robot>", more + "</robot>"))
        return {"units.a.urdf": str(path)}

    check_trial(load_scene("round_robots", robot("continuous", 121)))
    check_trial(load_scene("round_robots", robot("fixed", 200)))  # welded
    says = r"round_robots\.yaml: .*continuous122\.urdf: it has 128 joints, and PyBullet takes 127"
    with pytest.raises(SceneError, match=says):
        check_trial(load_scene("round_robots", robot("continuous", 122)))
