"""The command ``msrr calibrate``: the calibration of a camera from pictures of a board."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import islice
from pathlib import Path
from statistics import mode
from typing import TYPE_CHECKING, Annotated

import typer

from msrr_bullet.cli.calibration_report import print_report, summary
from msrr_bullet.cli.console import open_console, status_line
from msrr_bullet.cli.options import (
    STANDARD_OUTPUT,
    JsonFile,
    check_no_source,
    check_writable,
    write_output,
)
from msrr_scenes.errors import SceneError

if TYPE_CHECKING:  # loaded by the command, so that msrr --help is quick
    from msrr_perception.camera_calibration.boards import Board
    from msrr_perception.camera_calibration.fit import BoardView
    from msrr_perception.camera_calibration.result import CameraCalibration
    from msrr_scenes.geometry.lens import Lens
    from msrr_scenes.messages import Pixels

#: Relative uncertainty of the focal length of no calibration.
_NO_FOCAL = 0.2

#: Residual of no calibration [px], and over the longer side of the pictures if that is more; the corners of
#: blurred pictures are better known.
_NO_FIT_PX, _NO_FIT = 2.0, 1e-3


#: Number of pictures that are asked what they show: of a part of a board some show less than the others.
_HINTS = 5

#: Endings of the file of a calibration.
_YAML = ".yaml", ".yml"


class Kind(StrEnum):
    """Kinds of boards."""

    CHESSBOARD = "chessboard"
    CHARUCO = "charuco"
    APRILTAGS = "apriltags"


#: Families of markers if none is given.
_FAMILIES = {Kind.CHARUCO: "DICT_4X4_50", Kind.APRILTAGS: "tag36h11"}


def calibrate(
    images: Annotated[
        list[Path], typer.Argument(metavar="IMAGE...", help="Pictures of a board, or folders of pictures.")
    ],
    board: Annotated[
        str,
        typer.Option(
            metavar="CxR",
            help="Columns and rows: inner corners of a chessboard, squares of a charuco board, or tags.",
        ),
    ],
    square_mm: Annotated[
        float,
        typer.Option(
            metavar="MM", min=0.1, max=1e4, help="Edge of a square, or distance from tag to tag [mm]."
        ),
    ],
    kind: Annotated[Kind, typer.Option(help="Kind of the board.")] = Kind.CHESSBOARD,
    marker_mm: Annotated[
        float | None,
        typer.Option(metavar="MM", min=0.1, max=1e4, help="Edge of the black square of a marker [mm]."),
    ] = None,
    family: Annotated[
        str | None,
        typer.Option(
            help="Tag family, or dictionary of OpenCV for charuco.", show_default="tag36h11, DICT_4X4_50"
        ),
    ] = None,
    coefficients: Annotated[
        int | None,
        typer.Option(
            help="Free coefficients of the distortion, of k1, k2, p1, p2, k3: 0, 1, 2, 4 or 5.",
            show_default="as many as the pictures determine",
        ),
    ] = None,
    json_file: JsonFile = None,
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="Calibration for ROS and for scenes, or a folder for it.")
    ] = Path("runs/calibration/camera.yaml"),
) -> None:
    """Calibrate a camera from pictures of a board.

    Pictures that show none, or contradict the others, are named and left out.
    """
    from msrr_bullet.figures.plots.coverage import draw_coverage
    from msrr_bullet.run_folder import make_folder
    from msrr_perception.camera_calibration.fit import MODELS
    from msrr_perception.photographs.picture_files import picture_files
    from msrr_scenes.loading.calibration_file import write_calibration

    if coefficients not in (None, *MODELS):
        raise SceneError(f"--coefficients {coefficients}: expected one of {', '.join(map(str, MODELS))}")
    pattern = _board(kind, board, square_mm, marker_mm, family)
    files = picture_files(images)
    file = out if out.suffix in _YAML else out / "camera.yaml"
    if out.suffix and file.parent == out and not out.is_dir():
        raise SceneError(f"--out {out}: expected a file that ends in {' or '.join(_YAML)}, or a folder")
    written = [file, file.with_stem(f"{file.stem}_opencv"), file.with_suffix(".png")]
    check_no_source(file.parent, images)
    make_folder(file.parent)
    for name in written:
        if name.exists():
            check_writable(name, "--out", files)
    check_writable(json_file, "--json", [*files, *written])
    console = open_console(stderr=json_file == STANDARD_OUTPUT)
    with status_line(console, "reading the pictures") as show:
        found, pictures = _calibrated(pattern, files, coefficients, show)
        _refuse(found, kind, pattern, files)
        missed = pictures.missed
        doubt = _doubt(pattern, files, missed) if 2 * len(missed) > len(files) else ""
    try:
        write_output(
            json_file, json.dumps(summary(found, missed, pictures.repeated), indent=1, allow_nan=False) + "\n"
        )
        write_calibration(file, found.told)
        write_calibration(written[1], found.told, "opencv")
        draw_coverage(found, written[2])
    finally:
        print_report(console, found, missed, pictures.repeated, doubt, _measures(kind))
    console.print("files: " + ", ".join(map(str, written)), soft_wrap=True, highlight=False)


def _board(kind: Kind, size: str, square_mm: float, marker_mm: float | None, family: str | None) -> Board:
    from msrr_perception.camera_calibration.boards import BoardError, CharucoBoard, Chessboard, TagGrid

    numbers = re.fullmatch(r"(\d{1,3})x(\d{1,3})", size)
    if numbers is None:
        raise SceneError(f"--board {size}: expected columns and rows, such as 7x5")
    columns, rows = int(numbers[1]), int(numbers[2])
    if kind is Kind.CHESSBOARD:
        if marker_mm is not None or family is not None:
            raise SceneError("--marker-mm and --family: a chessboard has no markers; give --kind as well")
    elif marker_mm is None:
        raise SceneError(f"--kind {kind}: give the edge of its markers as well, --marker-mm MM")
    try:
        if marker_mm is None:
            return Chessboard(columns, rows, 1e-3 * square_mm)
        build = CharucoBoard if kind is Kind.CHARUCO else TagGrid
        return build(columns, rows, 1e-3 * square_mm, 1e-3 * marker_mm, family or _FAMILIES[kind])
    except BoardError as error:
        raise SceneError(f"--board {size}: {error}") from None


@dataclass
class _Pictures:
    """The boards found, names of pictures that show none, and of repeated pictures with what they repeat.

    All pictures have one size [px].
    """

    views: list[BoardView] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)
    repeated: list[tuple[str, str]] = field(default_factory=list)
    width: int = 0
    height: int = 0


def _calibrated(
    board: Board, files: Sequence[Path], coefficients: int | None, show: Callable[[str], None]
) -> tuple[CameraCalibration, _Pictures]:
    """Return the calibration and its pictures."""
    from msrr_perception.camera_calibration.boards import BoardError
    from msrr_perception.camera_calibration.fit import FEWEST_PICTURES, calibrate_camera

    read = _read_boards(board, files, None, show)
    if len(read.views) < FEWEST_PICTURES and 2 * len(read.missed) > len(files):  # OpenCV may misread one
        raise BoardError(_doubt(board, files, read.missed))
    found = calibrate_camera(read.views, read.width, read.height, coefficients)
    if board.uses_lens:
        read = _read_boards(board, files, found.told.lens(read.width, read.height), show)
        found = calibrate_camera(read.views, read.width, read.height, coefficients)
    return found, read


def _refuse(found: CameraCalibration, kind: Kind, board: Board, files: Sequence[Path]) -> None:
    """Refuse a camera that cannot have seen these boards, rather than to replace a good calibration by it.

    Raises:
        CalibrationError: The residual is large, or the focal length is as good as unknown.
    """
    from msrr_perception.camera_calibration.fit import CalibrationError

    told = found.told
    most_px = max(_NO_FIT_PX, _NO_FIT * max(told.width_px or 0, told.height_px or 0))
    if not found.rms_px <= most_px:  # which no NaN is
        raise CalibrationError(
            f"the best camera shows the boards {found.rms_px:.2f} px (RMS) from where they are, so the board "
            f"is not as told{_seen(board, files)}; check {_measures(kind)}; nothing was written"
        )
    if not found.sigma["fx_px"] <= _NO_FOCAL * told.fx_px:
        raise CalibrationError(
            f"the pictures do not tell the focal length ({told.fx_px:.0f} ± {found.sigma['fx_px']:.0f} px): "
            f"tilt the board by 30 to 45 degrees to all sides, and check {_measures(kind)}; nothing was "
            "written"
        )


def _measures(kind: Kind) -> str:
    """Return the options that say what the board is like."""
    also = "" if kind is Kind.CHESSBOARD else ", --family, --marker-mm"
    return f"--kind, --board{also} and --square-mm"


def _doubt(board: Board, files: Sequence[Path], missed: Sequence[str]) -> str:
    """Return how many pictures show the board, what one of the others shows, and what may be wrong."""
    seen = _seen(board, (*map(Path, missed), *files))
    shown = f"{len(files) - len(missed)} of {len(files)} pictures show the board"
    return f"{shown}{seen}; are --kind, --family and --board right?"


def _seen(board: Board, files: Sequence[Path]) -> str:
    """Return what most of the first pictures show that show anything like a board, or an empty text."""
    hints = ((file, board.hint(_read(file))) for file in files)
    some = list(islice(((file, text) for file, text in hints if text), _HINTS))
    texts = [text for _, text in some]
    return next((f"; {file} shows {text}" for file, text in some if text == mode(texts)), "")


def _read_boards(
    board: Board, files: Sequence[Path], lens: Lens | None, show: Callable[[str], None]
) -> _Pictures:
    """Return the boards in some pictures, each of them once."""
    from msrr_perception.camera_calibration.fit import BoardView
    from msrr_perception.photographs.picture_files import PictureError, Repeats

    read, repeats = _Pictures(), Repeats()
    for i, file in enumerate(files):
        show(f"{i + 1} of {len(files)}: {file}")
        pixels = _read(file)
        height, width = pixels.shape
        if i == 0:
            read.width, read.height = width, height
        if (width, height) != (read.width, read.height):
            raise PictureError(
                f"{file}: {width} x {height} px, and {files[0]} has {read.width} x {read.height} px; a "
                "calibration belongs to pictures of one size"
            )
        first = repeats.first(str(file), pixels)
        if first is not None:
            read.repeated.append((str(file), first))
            continue
        points = board.find(pixels, lens)
        if points is None:
            read.missed.append(str(file))
        else:
            read.views.append(BoardView(str(file), points))
    return read


def _read(file: Path) -> Pixels:
    from msrr_perception.photographs.picture_files import FILMS, PictureError, read_picture

    if file.suffix.lower() in FILMS:
        raise PictureError(f"{file}: a film; take ten to twenty sharp pictures out of it")
    return read_picture(file)
