from __future__ import annotations

import dataclasses
import json
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import BAD_INPUT
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import TagDetection

CALIBRATION = """
image_width: 160
image_height: 140
camera_matrix: {rows: 3, cols: 3, data: [200.0, 0, 79.5, 0, 200.0, 69.5, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder with a picture of tag 5, 64 px wide and seen from the front, and a file that is no picture."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    tag = np.rot90(cv2.aruco.generateImageMarker(family, 5, 64), 2)
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    cv2.imwrite(str(pictures / "tag.png"), np.pad(tag, ((38, 38), (48, 48)), constant_values=230))
    (pictures / "bad.png").write_bytes(b"no picture")
    (tmp_path / "camera.yaml").write_text(CALIBRATION)
    return pictures


def test_poses_are_printed(
    folder: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tag is 64 px wide at 200 px of focal length, in the middle of the picture."""
    monkeypatch.setenv("COLUMNS", "200")
    cv2.imwrite(str(folder / "bad.png"), np.full((140, 160), 200, np.uint8))
    assert run(["detect", str(folder), "--calibration", "camera.yaml", "--tag-size", "0.1"]) == 0
    rows = [line.replace("\u2502", " ").split() for line in capfd.readouterr().out.splitlines()]
    none, found = (row for row in rows if row and row[0].endswith(".png"))
    assert none[1:] == ["none"]
    assert found[1] == "5"
    assert [float(x) for x in found[2:5]] == pytest.approx([0.0, 0.0, 0.3125], abs=0.002)
    assert float(found[6]) < 0.1


def test_what_poses_need_besides_the_camera_is_said(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The calibration alone refines the corners and gives no pose."""
    hint = "no poses: they need the size of the tags as well; give --tag-size M"
    for options, told in (([], False), (["--calibration", "camera.yaml"], True)):
        assert run(["detect", str(folder / "tag.png"), *options]) == 0
        assert (hint in " ".join(capfd.readouterr().out.split())) == told


def test_numbers_are_not_written_over_a_picture(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    before = (folder / "tag.png").read_bytes()
    for file in (str(folder / "tag.png"), "camera.yaml"):
        options = ["--calibration", "camera.yaml", "--tag-size", "0.1", "--json", file]
        assert run(["detect", str(folder), *options]) == BAD_INPUT
        assert f"--json {file}: the command uses this file already" in capfd.readouterr().err
    assert (folder / "tag.png").read_bytes() == before


def test_good_pictures_are_read_and_bad_ones_reported(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    options = ["--calibration", "camera.yaml", "--tag-size", "0.1", "--json", "tags.json", "--out", "drawn"]
    assert run(["detect", str(folder), *options]) == BAD_INPUT
    printed = capfd.readouterr()
    assert printed.err.count("\n") == 1
    assert "bad.png: not a picture" in printed.err
    assert "1 picture, 1 tag" in printed.out
    (image,) = json.loads(Path("tags.json").read_text())["images"]
    (tag,) = image["detections"]
    assert {field.name for field in dataclasses.fields(TagDetection)} <= tag.keys()  # as in the log
    assert (tag["tag_id"], tag["family"], tag["hamming"]) == (5, "tag36h11", 0)
    np.testing.assert_allclose(tag["corners"][0], [47.5, 101.5], atol=0.1)
    assert len(tag["corner_sigma_px"]) == 4
    assert 0.0 < max(tag["corner_sigma_px"]) < 0.1
    pose = tag["poses"][0]
    np.testing.assert_allclose(pose["p_CT_m"], [0.0, 0.0, 0.1 * 200.0 / 64.0], atol=0.002)
    assert np.shape(pose["covariance"]) == (6, 6)
    drawn = cv2.imread("drawn/tag.png.png")
    assert (drawn[..., 2].astype(int) - drawn[..., 0] > 60).any()  # the outline is red


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--tag-size", "0.1"], "give --calibration"),
        (["--family", "tag36h1"], "did you mean 'tag36h11'"),
        (["--calibration", "missing.yaml"], "missing.yaml"),
        (["--calibration", "camera.yaml", "--tag-size", "30"], "10 m at most, found 30"),
        (["--json", "no/folder.json"], "existing folder"),
    ],
)
def test_wrong_options_are_one_message(
    folder: Path, capfd: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    assert run(["detect", str(folder / "tag.png"), *options]) == BAD_INPUT
    error = capfd.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_without_any_tag_the_families_are_named(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["detect", str(folder / "tag.png"), "--family", "tagStandard41h12"]) == 0
    told = " ".join(capfd.readouterr().out.split())
    assert "no tag of tagStandard41h12 was found; --family names another family" in told
    assert run(["detect", str(folder / "tag.png")]) == 0
    assert "--family" not in capfd.readouterr().out


def test_a_calibration_of_another_size_is_refused(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    cv2.imwrite(str(folder / "tag.png"), np.full((100, 100), 200, np.uint8))
    assert run(["detect", str(folder / "tag.png"), "--calibration", "camera.yaml"]) == BAD_INPUT
    assert "calibration is of pictures of 160 x 140 px" in capfd.readouterr().err


def test_numbers_are_written_where_the_table_cannot_be(folder: Path) -> None:
    command = f"{sys.executable} -m msrr_bullet detect {folder / 'tag.png'} --json n.json > /dev/full"
    ended = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert ended.returncode == BAD_INPUT
    assert "Traceback" not in ended.stderr
    assert len(json.loads(Path("n.json").read_text())["images"]) == 1


def test_what_was_read_is_reported_where_the_next_picture_cannot_be_drawn(
    folder: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full at the second picture, or Ctrl-C ends the work there."""
    shutil.copy(folder / "tag.png", folder / "tag2.png")
    (folder / "bad.png").unlink()
    for error, code in ((MsrrError("no room"), BAD_INPUT), (KeyboardInterrupt(), 130)):

        def fail_at_second(path: Path, image: object, error: BaseException = error) -> None:
            if path.name.startswith("tag2"):
                raise error

        monkeypatch.setattr("msrr_bullet.figures.drawing.canvas.write_png", fail_at_second)
        assert run(["detect", str(folder), "--out", "drawn", "--json", "n.json"]) == code
        assert "2 pictures, 2 tags" in capfd.readouterr().out
        assert len(json.loads(Path("n.json").read_text())["images"]) == 2


def test_errors_of_opencv_are_reported_once(folder: Path) -> None:
    cv2.imwrite("whole.tiff", np.full((100, 100), 200, np.uint8))
    Path("cut.tiff").write_bytes(Path("whole.tiff").read_bytes()[:60])
    ended = subprocess.run([sys.executable, "-m", "msrr_bullet", "detect", "cut.tiff"], capture_output=True)
    assert ended.returncode == BAD_INPUT
    assert ended.stderr.decode().splitlines() == [
        "msrr: cut.tiff: not a picture that OpenCV can read, or a damaged one"
    ]


@pytest.mark.parametrize(
    "command",
    [
        ["calibrate", "--board", "7x5", "--square-mm", "30", "--out", "pictures/camera.yaml"],
        ["map", "--calibration", "camera.yaml", "--tag-size", "0.05", "--out", "pictures"],
    ],
)
def test_no_figures_are_written_among_the_pictures_that_are_read(
    folder: Path, command: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    assert run([command[0], str(folder), *command[1:]]) == BAD_INPUT
    assert "name another folder" in capfd.readouterr().err


def test_nothing_is_drawn_among_the_pictures_that_are_read(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The next command would read what was drawn, too, and calibrations refuse pictures of two sizes."""
    before = sorted(folder.iterdir())
    assert run(["detect", str(folder), "--out", str(folder / ".." / folder.name)]) == BAD_INPUT
    assert "name another folder" in capfd.readouterr().err
    assert sorted(folder.iterdir()) == before
