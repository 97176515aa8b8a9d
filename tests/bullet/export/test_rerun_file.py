"""Recordings of Rerun: it finds what the log shows, by its own reader and by what is added."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from msrr_bullet.export.rerun_file import write_rerun
from msrr_bullet.log import unpacked_log
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
