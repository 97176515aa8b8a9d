"""The command calibrates from files, writes files that scenes take, and answers bad input in one message."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import BAD_INPUT
from msrr_scenes.loading.calibration_file import read_calibration
from msrr_scenes.loading.load import load_scene

K = np.array([[240.0, 0.0, 159.5], [0.0, 240.0, 119.5], [0.0, 0.0, 1.0]])
SQUARE, CELL_PX = 0.03, 12
BOARD = ["--board", "5x4", "--square-mm", "30"]


def picture(
    turn: tuple[float, float], place: tuple[float, float, float], squares: tuple[int, int] = (5, 6)
) -> np.ndarray:
    """A chessboard, 5 x 4 inner corners, as an ideal camera shows it, the middle at a place [m]."""
    cells = np.pad(np.indices(squares).sum(axis=0) % 2, 1, constant_values=1)
    board = np.kron(170 * cells + 40, np.ones((CELL_PX, CELL_PX))).astype(np.uint8)
    R = cv2.Rodrigues(np.array([*turn, 0.1]))[0]
    scale = SQUARE / CELL_PX
    middle = 0.5 * np.array(board.shape[::-1]) * scale
    # Pixel centres of the print are at halves of its pixels.
    to_board = np.array([[scale, 0, 0.5 * scale - middle[0]], [0, scale, 0.5 * scale - middle[1]], [0, 0, 1]])
    H = K @ np.column_stack([R[:, :2], place]) @ to_board
    shown = cv2.warpPerspective(board, H, (320, 240), flags=cv2.INTER_LINEAR, borderValue=100)
    return cv2.GaussianBlur(shown, (0, 0), 0.6)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four tilted boards, and one picture without a board."""
    folder = tmp_path_factory.mktemp("pictures")
    turns = ((0.5, 0.0), (0.0, 0.5), (-0.4, 0.2), (0.2, -0.5))
    places = ((0.0, 0.0), (0.05, 0.0), (0.0, 0.04), (-0.05, 0.0))
    for i, (turn, aside) in enumerate(zip(turns, places, strict=True)):
        cv2.imwrite(str(folder / f"board_{i}.png"), picture(turn, (*aside, 0.28)))
    cv2.imwrite(str(folder / "wall.png"), np.full((240, 320), 120, np.uint8))
    return folder


def test_files_are_written_that_a_scene_takes(pictures: Path, capfd: pytest.CaptureFixture[str]) -> None:
    options = [*BOARD, "--coefficients", "0", "--out", "head.yaml", "--json", "head.json"]
    assert run(["calibrate", str(pictures), *options]) == 0
    printed = capfd.readouterr().out
    assert "no board: " in printed
    assert "wall.png" in printed
    told = read_calibration(Path("head.yaml"))
    assert read_calibration(Path("head_opencv.yaml")) == told
    found = json.loads(Path("head.json").read_text())
    for name, truth in {"fx_px": 240.0, "fy_px": 240.0, "cx_px": 159.5, "cy_px": 119.5}.items():
        assert abs(found["calibration"][name] - truth) < max(3.0 * found["sigma"][name], 1.0), name
    assert found["rms_px"] < 0.1
    assert [image["points"] for image in found["images"]] == [20] * 4
    assert cv2.imread("head.png").std() > 5.0
    size = {"cameras.onboard.width_px": "320", "cameras.onboard.height_px": "240"}
    scene = load_scene("close_range", {"cameras.onboard.calibration": "head.yaml"} | size)
    assert scene.cameras.onboard.calibration == told


def test_what_is_wrong_is_one_message(pictures: Path, capfd: pytest.CaptureFixture[str]) -> None:
    board = str(pictures / "board_0.png")
    cv2.imwrite("large.png", np.full((480, 640), 120, np.uint8))
    Path("film.mp4").write_bytes(b"")
    for arguments, message in (
        (
            [board, "--board", "9x6", "--square-mm", "30"],
            "board_0.png shows a chessboard of 5x4 inner corners",
        ),
        (
            [str(pictures / "wall.png"), *BOARD],
            "pictures show the board; are --kind, --family and --board right?",
        ),
        ([board, *BOARD], "1 picture(s) with a board; 3 are the fewest"),
        ([board, "large.png", *BOARD], "large.png: 640 x 480 px, and "),
        (["film.mp4", *BOARD], "film.mp4: a film; take ten to twenty sharp pictures"),
        ([board, "--board", "5", "--square-mm", "30"], "--board 5: expected columns and rows"),
        ([board, "--board", "1x5", "--square-mm", "30"], "--board 1x5: a chessboard has 3 x 3 inner corners"),
        ([board, *BOARD, "--kind", "charuco"], "--kind charuco: give the edge of its markers"),
        ([board, *BOARD, "--marker-mm", "20"], "a chessboard has no markers"),
        ([board, *BOARD, "--coefficients", "3"], "--coefficients 3: expected one of 0, 1, 2, 4, 5"),
    ):
        assert run(["calibrate", *arguments]) == BAD_INPUT, arguments
        error = capfd.readouterr().err
        assert message in error
        assert error.count("\n") == 1


def test_a_board_is_in_doubt_if_most_pictures_show_another(
    pictures: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """One of five pictures shows the board, as if OpenCV had misread it; then most show a part of one."""
    for file in pictures.glob("board_*.png"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    cv2.imwrite(str(tmp_path / "last.png"), picture((0.2, 0.4), (0.0, 0.0, 0.35), (6, 8)))
    assert run(["calibrate", str(tmp_path), "--board", "7x5", "--square-mm", "30"]) == BAD_INPUT
    error = capfd.readouterr().err
    assert "1 of 5 pictures show the board; " in error
    assert "board_0.png shows a chessboard of 5x4 inner corners; are --kind, --f" in error
    out = tmp_path / "part.yaml"
    part = ["--board", "5x3", "--square-mm", "30", "--out", str(out)]
    assert run(["calibrate", str(pictures), *part]) == BAD_INPUT
    error = capfd.readouterr().err
    assert re.search(r"px \(RMS\) from where they are, so the board is not as told; .* shows a chess", error)
    assert "of 5x4 inner corners; check --kind, --board and --square-mm; nothing was written" in error
    assert not out.exists()
