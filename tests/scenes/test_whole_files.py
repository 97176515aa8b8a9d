"""Files are written as a whole or not at all, wherever they are."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from msrr_scenes.loading.calibration_file import read_calibration, write_calibration
from msrr_scenes.specs.sensors import CalibrationSpec
from msrr_scenes.whole_files import whole_file, write_whole

Room = Callable[[int], AbstractContextManager[None]]


def test_a_full_disk_loses_no_older_calibration(tmp_path: Path, room: Room) -> None:
    file = tmp_path / "camera.yaml"
    told = CalibrationSpec(fx_px=600.0, fy_px=600.0, cx_px=320.0, cy_px=240.0, width_px=640, height_px=480)
    write_calibration(file, told)
    with room(16), pytest.raises(OSError, match="File too large"):
        write_calibration(file, told.model_copy(update={"fx_px": 610.0}))
    assert read_calibration(file) == told
    assert os.listdir(tmp_path) == ["camera.yaml"]


def test_a_link_leads_to_the_file_and_a_device_stays_one(tmp_path: Path) -> None:
    file, link = tmp_path / "file.txt", tmp_path / "link.txt"
    link.symlink_to(file)
    write_whole(link, "told")
    assert link.is_symlink()
    assert file.read_text() == "told"
    write_whole(Path(os.devnull), "told")
    assert Path(os.devnull).is_char_device()


def test_an_interrupt_leaves_the_older_file(tmp_path: Path) -> None:
    file = tmp_path / "film.mp4"
    write_whole(file, b"older")

    def interrupted() -> None:
        with whole_file(file, ".mp4") as part:
            part.write_bytes(b"new")
            assert part.suffix == ".mp4"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert file.read_bytes() == b"older"
    assert os.listdir(tmp_path) == ["film.mp4"]
