"""The program: help, versions, the commands scenes and check, and bad input."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from msrr_bullet.cli.app import program, run
from msrr_scenes.loading.calibration_file import write_calibration
from msrr_scenes.loading.file_schema import KINDS
from msrr_scenes.loading.load import shipped_scenes
from msrr_scenes.specs.sensors import CalibrationSpec

Capture = pytest.CaptureFixture[str]


def test_help_and_version(capsys: Capture) -> None:
    assert run(["--help"]) == 0
    told = capsys.readouterr().out.split()
    assert set(COMMANDS) <= set(told)
    assert run(["--version"]) == 0
    assert "pybullet" in capsys.readouterr().out


COMMANDS = program().commands


@pytest.mark.parametrize("name", COMMANDS)
def test_help_shows_every_default(name: str, capsys: Capture) -> None:
    """Also those that are described in words, which the help marks by brackets, too."""
    assert run([name, "--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for parameter in COMMANDS[name].params:
        described = getattr(parameter, "show_default", None)
        if isinstance(described, str):
            assert f"[default: ({described})" in shown, parameter.name
        elif not callable(parameter.default) and parameter.default not in (None, False):
            assert f"[default: {parameter.default}" in shown, parameter.name
        elif parameter.name == "out":
            pytest.fail(f"msrr {name} --out: the help does not say where its files go")


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("msrr swe", ["sweep"]),
        ("msrr sweep --se", ["--seeds", "--set"]),
        ("msrr dock two_u", ["two_units", "two_units_free"]),
        ("msrr check close_range two_o", ["two_obstacles"]),
    ],
)
def test_a_shell_completes_commands_options_and_scenes(
    words: str, offered: list[str], capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("_MSRR_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(words.count(" ")))
    assert run([]) == 0
    assert capsys.readouterr().out.split() == offered


def test_scenes_are_listed(capsys: Capture) -> None:
    assert run(["scenes"]) == 0
    out = capsys.readouterr().out
    for name in shipped_scenes():
        assert name in out


def test_schema(capsys: Capture, tmp_path: Path) -> None:
    assert run(["schema", "--out", "scene.schema.json"]) == 0
    assert run(["schema", "scene"]) == 0
    assert capsys.readouterr().out == (tmp_path / "scene.schema.json").read_text()
    assert run(["schema", "scnee"]) == 2
    assert "did you mean 'scene'?" in capsys.readouterr().err


def test_the_help_of_schema_names_every_kind_of_file(capsys: Capture) -> None:
    assert run(["schema", "--help"]) == 0
    said = capsys.readouterr().out
    assert [kind for kind in KINDS if kind not in said] == []


def test_help_and_the_list_of_scenes_load_nothing_that_only_a_trial_needs() -> None:
    """The models of a scene alone take twice as long as all the rest of the help."""
    helped, listed = _loaded_by("--help", "scenes")
    assert "typer" in helped
    assert helped.isdisjoint({"numpy", "pydantic", "pybullet", "cv2", "rich", "multiprocessing"})
    assert listed.isdisjoint({"pybullet", "cv2", "fcl", "matplotlib", "meshcat"})


def test_a_check_loads_nothing_that_it_does_not_need() -> None:
    """The compiler of the kernels, which a run needs, alone takes a third as long as the check does.

    SciPy's packages take as long as all else that the check imports; a mission assigns places with it.
    """
    pair, mission = _loaded_by("check two_units close_range", "check assemble_cross")
    assert {"pybullet", "msrr_perception.kernels.update", "msrr_bullet.render.raster.rasterizer"} <= pair
    assert [module for module in pair if module.partition(".")[0] == "scipy"] == []
    assert "msrr_bullet.trial.mission" in pair
    of_missions = {"msrr_bullet.base_station", "msrr_bullet.trial.coordinated_mission", "numpy.ma"}
    assert pair.isdisjoint({*of_missions, "msrr_control.coordination.coordinator"})
    needless = {"numba", "llvmlite", "matplotlib", "rich", "jinja2", "mcap", "foxglove", "zstandard"}
    assert mission.isdisjoint({*needless, "meshcat", "tornado", "google.protobuf", "multiprocessing"})


@pytest.mark.parametrize("wanted", [None, "another"])
def test_the_program_asks_no_package_for_plugins_of_pydantic(wanted: str | None) -> None:
    """That would read the metadata of every package that is installed; who wants to, has them read."""
    program = (
        "import sys; from msrr_bullet.cli import main; sys.argv = ['msrr', 'schema', 'target']\n"
        "try: main()\n"
        "finally: from pydantic.plugin import _loader; print('read', _loader._plugins is not None)"
    )
    environment = {key: value for key, value in os.environ.items() if key != "PYDANTIC_DISABLE_PLUGINS"}
    if wanted is not None:
        environment["PYDANTIC_DISABLE_PLUGINS"] = wanted
    command = [sys.executable, "-c", program]
    said = subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout
    assert said.splitlines()[-1] == f"read {wanted is not None}"


def _loaded_by(*commands: str) -> list[set[str]]:
    """Return the modules that a process has loaded after each of several commands."""
    program = (
        "import sys; from msrr_bullet.cli.app import run\n"
        "for line in sys.argv[1:]: run(line.split()); print('loaded', *sys.modules)"
    )
    command = [sys.executable, "-c", program, *commands]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return [set(line.split()[1:]) for line in said.splitlines() if line.startswith("loaded ")]


def test_check(capsys: Capture, tmp_path: Path) -> None:
    assert run(["check", "close_range"]) == 0
    shown = "close_range: ok (2 units, 0 obstacles; a.front to b.rear; as built: {}; "
    assert shown.format("careful") in capsys.readouterr().out
    assert run(["check", "close_range", "--set", "as_built=perfect"]) == 0
    assert shown.format("perfect") in capsys.readouterr().out
    assert run(["check", "round_robots"]) == 0  # wheels of 40 mm in radius, 75 mm to each side
    assert ", wheels 80 mm across, track 150 mm (b, a)\n" in capsys.readouterr().out
    (tmp_path / "bad.yaml").write_text("units: {}\n")
    assert run(["check", "bad.yaml", "close_range"]) == 2  # one is bad, the other is still checked
    out, err = capsys.readouterr()
    assert err.startswith("msrr: bad.yaml:1:1: ")
    assert "close_range: ok" in out
    assert run(["check", "close_range", "corridor", "--set", "time_limit=9"]) == 2
    places = [line.partition(": time_limit: ")[0] for line in capsys.readouterr().err.splitlines()]
    assert places == [f"msrr: {name}: --set time_limit=9" for name in ("close_range", "corridor")]


@pytest.mark.parametrize(
    ("arguments", "out"),
    [
        (["detect", "tag.png"], "/proc/out"),
        (["detect", "tag.png"], "file/out"),
        (["map", "tag.png", "--calibration", "camera.yaml", "--tag-size", "0.1"], "/proc"),
        (["calibrate", "tag.png", "--board", "7x5", "--square-mm", "30"], "/proc/out"),
        (["tolerance", "close_range"], "/proc"),
        (["reproduce"], "file/out"),
        (["film", "RUN"], "/proc"),
        (["film", "RUN"], "file/out"),
        (["plot", "RUN"], "/proc/out"),
        (["export", "RUN", "--rerun"], "/proc"),
        (["schema"], "file/out"),
    ],
)
def test_a_place_that_cannot_be_written_is_named_before_the_work(
    arguments: list[str],
    out: str,
    blind_run: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "RUN").symlink_to(blind_run)
    for name in ("tag.png", "file"):
        (tmp_path / name).write_bytes(b"")
    told = CalibrationSpec(fx_px=60, fy_px=60, cx_px=32, cy_px=32, width_px=64, height_px=64)
    write_calibration(tmp_path / "camera.yaml", told)
    place = f"{out}/file.png" if arguments[0] in ("film", "plot", "export", "schema") else out
    assert run([*arguments, "--out", place]) == 2
    shown, message = capsys.readouterr()
    assert shown == ""
    assert message.startswith((f"msrr: --out {place}: ", f"msrr: {place}: ")), message
    assert message.count("\n") == 1
    assert re.search(r"choose another --out|name another place|not a file in an existing folder", message)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["dock", "close_rang"], "did you mean 'close_range'?"),
        (["dock", "no/such.yaml"], "no/such.yaml: no such scene file"),
        (["dock", "close_range", "--set", "los.inner_deg"], "expected KEY=VALUE"),
        (["dock", "close_range", "--set", "los.iner_deg=3"], "msrr: --set los.iner_deg=3: los.iner_deg: "),
        (["dock", "close_range", "--set", "name=a", "--set", "name=b"], "give it once"),
        (["dock", "close_range", "--seed", "-1"], "--seed"),
        (["dock", "close_range", "--seed", "one"], "--seed"),
        (["dock"], "SCENE"),
        (["dok", "close_range"], "dok"),
        (["sweep", "close_range", "--seeds", "4:4"], "A < B"),
        (["sweep", "close_range", "--seeds", "a:b"], "expected A:B"),
        (
            ["sweep", "close_range", "--seeds", "0:5,7"],
            "expected a list of seeds, such as 3,8,15, and not '0:5'",
        ),
        (["tolerance", "close_range", "--grade-seeds", "5"], "--grade-seeds 5: a single number is ambiguous"),
        (["sweep", "close_range", "--seeds", "5"], "give 0:5 for 5 seeds or 5:6 for seed 5 alone"),
        (["sweep", "close_range", "--jobs", "0"], "--jobs"),
        (["sweep", "close_range", "--json", "no/such/folder.json"], "not a file in an existing folder"),
        (["bench", "close_range", "--json", "."], "not a file in an existing folder"),
        (["check", "."], ".: a folder; name a scene file in it"),
        (["check", "/dev/null"], "/dev/null: not a regular file"),
        (["dock", "close_range", "--out", ""], "an argument is empty; give it a value"),
        (["dock", "close_range", "--out="], "an argument is empty; give it a value"),
        (["replay", "no/such/run"], "cannot read the log: No such file or directory; name a run folder, or"),
        (["film", "no/such/run"], "no/such/run: cannot read the log"),
        (["plot", "no/such/run"], "no/such/run: cannot read the log"),
        (["export", "no/such/run", "--rerun"], "no/such/run: cannot read the log"),
    ],
)
def test_bad_input_is_one_message_and_code_2(arguments: list[str], message: str, capsys: Capture) -> None:
    assert run(arguments) == 2
    out, err = capsys.readouterr()
    assert message in err
    assert "Traceback" not in err
    assert out == ""


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=pytest.mark.nightly)])
def test_a_signal_to_end_unwinds(number: int) -> None:
    """The time limit holds from the signal on; how long the program takes to start depends on the machine."""
    code = (
        "import signal, sys, time, msrr_bullet.cli.app as cli, msrr_bullet.run as r\n"
        "import msrr_bullet.sensors.preparation as preparation\n"
        # These tests may run under nohup, whose programs are to go on at SIGHUP, this one too.
        f"signal.signal({int(number)}, signal.SIG_DFL)\n"
        "def trial(*a, **k):\n"
        "    try:\n"
        "        print('the trial runs', flush=True)\n"
        "        while True:\n"
        "            time.sleep(0.1)\n"
        "    finally:\n"
        "        print('closed', file=sys.stderr)\n"
        "r.run_trial = trial\n"
        "preparation.prepare_cameras = lambda *a: None\n"
        "sys.argv = ['msrr', 'dock', 'close_range']\n"
        "cli.main()\n"
    )
    program = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    with program:
        try:
            assert program.stdout is not None
            assert "the trial runs\n" in program.stdout, program.communicate()[1]
            program.send_signal(number)
            _, said = program.communicate(timeout=60)
        finally:
            program.kill()
    assert program.returncode == 128 + number
    assert "closed" in said
    assert "Traceback" not in said


@pytest.mark.parametrize("closed", [">&-", "<&- >&- 2>&-"])
def test_standard_streams_may_be_closed(closed: str) -> None:
    command = f"{sys.executable} -m msrr_bullet check close_range {closed}"
    done = subprocess.run(command, shell=True, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_no_file_gets_the_number_of_a_closed_stream() -> None:
    """What PyBullet prints from C would land in it."""
    code = (
        "import os, sys, msrr_bullet.cli.app as cli\n"
        "cli.run = lambda _: os.open(os.devnull, os.O_WRONLY)\n"
        "cli.main()\n"
    )
    for closed in ("<&-", ">&-", "2>&-"):
        assert subprocess.run(f"{sys.executable} -c '{code}' {closed}", shell=True).returncode > 2


@pytest.mark.parametrize("daemon", [True, False])
def test_a_thread_that_keeps_the_program_from_ending_is_named(daemon: bool) -> None:
    """All was done, and nothing said why the program did not end."""
    program = (
        "import sys, threading, time\n"
        "from msrr_bullet.cli import app\n"
        "app._SILENT_S = 0.2\n"
        f"threading.Thread(target=time.sleep, args=[2.0], name='of mine', daemon={daemon}).start()\n"
        "sys.argv = ['msrr', '--help']\n"
        "app.main()\n"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert ran.returncode == 0
    assert ("Python waits for of mine, as it does" in ran.stderr) is not daemon
    assert daemon is (ran.stderr == "")
