"""Recordings of Rerun: it finds what the log shows, by its own reader and by what is added."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from msrr_bullet.export.rerun_file import write_rerun
from msrr_bullet.log import unpacked_log
from msrr_bullet.log.reader import LOG_NAME
from msrr_scenes.errors import MsrrError


@pytest.mark.nightly
def test_rerun_finds_images_cameras_transforms_and_drawings(short_run: Path, tmp_path: Path) -> None:
    with unpacked_log(short_run) as log:
        write_rerun(log, tmp_path / "t.rrd")
    printed = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "print", str(tmp_path / "t.rrd")],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stdout
    lines = printed.splitlines()
    for entity, component in {
        "/camera/a/onboard/image": "EncodedImage:blob",
        "/camera/overhead/image": "EncodedImage:blob",
        "/camera/overhead/calibration": "Pinhole:image_from_camera",
        "/tf": "Transform3D:translation",
        "/log": "TextLog:text",
        "/perception/a/pose": "InstancePoses3D:translations",
        "/bodies/b": "Boxes3D:half_sizes",
        "/camera/a/onboard/image/tags": "LineStrips2D:strips",
        "/curves/a/x_mm": "Scalars:scalars",
    }.items():
        assert any(f" - {entity} - " in line and component in line for line in lines), entity


def test_without_rerun_the_message_says_what_to_install(
    short_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with unpacked_log(short_run) as log, pytest.raises(MsrrError, match=r"msrr-bullet\[rerun\]"):
        write_rerun(log, tmp_path / "t.rrd")


def test_a_recording_that_cannot_be_written_whole_is_an_error_and_leaves_no_file(
    short_run: Path, tmp_path: Path, room: Callable[[int], AbstractContextManager[None]]
) -> None:
    pytest.importorskip("rerun")
    (tmp_path / "folder.rrd").mkdir()
    with unpacked_log(short_run) as log:
        for path in (tmp_path / "folder.rrd", tmp_path / "no" / "t.rrd"):
            with pytest.raises(MsrrError, match=f"{path}: cannot be written"):
                write_rerun(log, path)
        with pytest.raises(MsrrError, match=r"t\.rrd: cannot be written to its end"), room(65_536):
            write_rerun(log, tmp_path / "t.rrd")
    assert list(tmp_path.iterdir()) == [tmp_path / "folder.rrd"]


@pytest.mark.parametrize("part", [0.5, 0.999], ids=["messages", "summary"])
def test_a_damaged_log_is_told_once_and_leaves_the_recording_of_before(
    part: float, short_run: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Rerun tells of it in lines of its own, and some damage makes it end the process."""
    pytest.importorskip("rerun")
    data = bytearray((short_run / LOG_NAME).read_bytes())
    start = round(part * len(data))
    data[start : start + 100] = bytes(100)
    (tmp_path / LOG_NAME).write_bytes(data)
    (tmp_path / "t.rrd").write_text("of before")
    with unpacked_log(tmp_path) as log, pytest.raises(MsrrError, match="the log is damaged"):
        write_rerun(log, tmp_path / "t.rrd")
    assert {path.name for path in tmp_path.iterdir()} == {LOG_NAME, "t.rrd"}
    assert (tmp_path / "t.rrd").read_text() == "of before"
    assert capfd.readouterr() == ("", "")


def test_rerun_is_not_given_a_log_that_ends_early(short_run: Path, tmp_path: Path) -> None:
    """It reads nothing of it, and says so in its own log alone."""
    pytest.importorskip("rerun")
    cut = tmp_path / LOG_NAME
    cut.write_bytes((short_run / LOG_NAME).read_bytes()[:-20])
    with unpacked_log(cut) as log, pytest.raises(MsrrError, match="the log ends early"):
        write_rerun(log, tmp_path / "t.rrd")
    assert not (tmp_path / "t.rrd").exists()


def test_a_recording_is_not_written_over_a_file_of_another_kind(short_run: Path) -> None:
    size = (short_run / "trial.mcap").stat().st_size
    with unpacked_log(short_run) as log, pytest.raises(MsrrError, match=r"ends in \.rrd"):
        write_rerun(log, short_run / "trial.mcap")
    assert (short_run / "trial.mcap").stat().st_size == size
