"""The command ``msrr detect``."""

from __future__ import annotations

import itertools
import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from msrr_bullet.cli.console import open_console, status_line
from msrr_bullet.cli.exit_codes import BAD_INPUT, Terminated, report_error
from msrr_bullet.cli.options import (
    STANDARD_OUTPUT,
    JsonFile,
    check_no_source,
    check_writable,
    write_output,
)
from msrr_scenes.errors import MsrrError, SceneError
from msrr_scenes.wording import counted

if TYPE_CHECKING:
    from rich.table import Table

    from msrr_perception.photographs.reading import PictureReader, PictureTags
    from msrr_perception.photographs.tag_finder import FoundTag
    from msrr_perception.photographs.tag_poses import TagPose
    from msrr_scenes.messages import Pixels


@dataclass
class _Work:
    """What was done so far, and what the library would do with the same pictures and its defaults.

    ``failed`` counts files that could not be read; ``names`` are those of annotated pictures that were
    written.
    """

    pictures: list[PictureTags] = field(default_factory=list)
    failed: int = 0
    own_s: float = 0.0
    library_s: float = 0.0
    library_tags: int = 0
    names: set[str] = field(default_factory=set)


def detect(
    images: Annotated[
        list[Path], typer.Argument(metavar="IMAGE...", help="Pictures, films, or folders of them.")
    ],
    family: Annotated[
        list[str] | None,
        typer.Option(metavar="FAMILY", help="Tag family; may be repeated.", show_default="tag36h11"),
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Calibration of the camera, by OpenCV or ROS.")
    ] = None,
    tag_size: Annotated[
        float | None, typer.Option(metavar="M", help="Edge of the black square of the tags [m].")
    ] = None,
    json_file: JsonFile = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of annotated pictures.", show_default="none are drawn"),
    ] = None,
) -> None:
    """Find AprilTags in pictures and films.

    The exit code is 2 if one of the files cannot be read. Ctrl-C ends it, and what is done is reported.
    """
    from msrr_bullet.run_folder import make_folder
    from msrr_perception.photographs.picture_files import picture_files
    from msrr_perception.photographs.reading import PictureReader
    from msrr_scenes.loading.calibration_file import read_calibration

    if tag_size is not None and calibration is None:
        raise SceneError("--tag-size: poses need the camera as well; give --calibration FILE")
    told = None if calibration is None else read_calibration(calibration)
    reader = PictureReader(family or ["tag36h11"], told, tag_size)
    files = picture_files(images)
    check_writable(json_file, "--json", [*files, calibration])
    if out is not None:
        check_no_source(out, images)
        make_folder(out)
    console = open_console(stderr=json_file == STANDARD_OUTPUT)
    work, stopped = _Work(), None
    with status_line(console, "reading") as show:
        try:
            for i, file in enumerate(files):
                show(f"{i + 1} of {len(files)}: {file}")
                _read_file(file, reader, out, work)
        except (KeyboardInterrupt, Terminated, MsrrError) as error:  # what is done is reported
            if not work.pictures:
                raise
            stopped = error
    write_output(json_file, json.dumps(_report(work), indent=1) + "\n")
    if work.pictures:
        console.print(_table(work.pictures))
        console.print(_summary(work), highlight=False)
        if told is not None and tag_size is None:
            console.print(
                "no poses: they need the size of the tags as well; give --tag-size M", highlight=False
            )
        if not work.library_tags and not any(picture.tags for picture in work.pictures):
            searched = ", ".join(reader.families)
            console.print(f"no tag of {searched} was found; --family names another family", highlight=False)
    if stopped is not None:
        raise stopped
    raise typer.Exit(BAD_INPUT if work.failed else 0)


def _read_file(file: Path, reader: PictureReader, out: Path | None, work: _Work) -> None:
    """Read all pictures of a file; one that cannot be read is reported, and the work goes on."""
    from msrr_perception.photographs.picture_files import FILMS, PictureError, check_whole, read_pictures

    before = len(work.pictures)
    try:
        for name, pixels in read_pictures(file):
            start = time.process_time()
            picture = reader.read(name, pixels)
            work.own_s += time.process_time() - start
            _ask_the_library(pixels, reader, work)
            work.pictures.append(picture)
            if out is not None:
                _draw(picture, pixels, reader, out, work)
        if file.suffix.lower() in FILMS:
            check_whole(file, len(work.pictures) - before)
    except PictureError as error:
        work.failed += 1
        report_error(str(error), BAD_INPUT)


def _ask_the_library(pixels: Pixels, reader: PictureReader, work: _Work) -> None:
    """Measure what the library takes and finds with its own defaults."""
    from msrr_perception.detection.native_apriltag import LIBRARY_BITS, LIBRARY_SETTINGS, detect

    start = time.process_time()
    for family in reader.families:
        work.library_tags += len(detect(pixels, family, LIBRARY_SETTINGS, LIBRARY_BITS))
    work.library_s += time.process_time() - start


def _draw(picture: PictureTags, pixels: Pixels, reader: PictureReader, out: Path, work: _Work) -> None:
    from msrr_bullet.figures.drawing.canvas import write_png
    from msrr_bullet.figures.frames.photograph import PosedLens, draw_photograph

    lens = reader.lens(picture.width, picture.height)
    posed = PosedLens(lens, 0.5 * reader.tag_size) if lens is not None and reader.tag_size else None
    stem = Path(picture.name).name.replace("#", "-")
    name = next(n for n in _candidates(stem) if n not in work.names)
    work.names.add(name)
    write_png(out / name, draw_photograph(pixels, picture.name, picture.tags, posed))


def _candidates(stem: str) -> Iterator[str]:
    """Yield names for the annotated picture of a file: pictures of two folders may have one name."""
    yield f"{stem}.png"
    yield from (f"{stem}-{number}.png" for number in itertools.count(2))


def _table(pictures: Sequence[PictureTags]) -> Table:
    from rich.table import Table

    if _any_pose(pictures):
        return _pose_table(pictures)
    table = Table("picture", "size [px]", "tags")
    for picture in pictures:
        ids = ", ".join(_short(found) for found, _ in picture.tags)
        table.add_row(picture.name, f"{picture.width} x {picture.height}", ids or "none")
    return table


def _any_pose(pictures: Sequence[PictureTags]) -> bool:
    return any(poses for picture in pictures for _, poses in picture.tags)


def _pose_table(pictures: Sequence[PictureTags]) -> Table:
    """Return the best pose of each tag."""
    from rich.table import Table

    title = "The best pose of each tag in the camera [m, deg], and its residual [px]"
    table = Table(title=title, title_justify="left")
    table.add_column("picture", overflow="fold")
    table.add_column("tag")
    for column in ("right", "down", "away", "yaw", "residual"):
        table.add_column(column, justify="right")
    for picture in pictures:
        rows = [(_short(found), *_numbers(poses[:1])) for found, poses in picture.tags] or [("none",)]
        for i, row in enumerate(rows):
            table.add_row("" if i else picture.name, *row)
    return table


def _numbers(poses: Sequence[TagPose]) -> Iterator[str]:
    for pose in poses:
        yield from (f"{x:z.4f}" for x in pose.X_CT.p)
        yield from (f"{x:z.2f}" for x in (_yaw_deg(pose), pose.reprojection_px))


def _yaw_deg(pose: TagPose) -> float:
    """Return the angle by which a tag is turned about its vertical axis [deg]."""
    return math.degrees(math.atan2(pose.X_CT.R[0, 2], pose.X_CT.R[2, 2]))


def _short(found: FoundTag) -> str:
    family = "" if found.family == "tag36h11" else f"{found.family}:"
    return f"{family}{found.tag.tag_id}"


def _summary(work: _Work) -> str:
    from msrr_perception.photographs.reading import corner_sigma_px

    count, tags = len(work.pictures), sum(len(p.tags) for p in work.pictures)
    text = (
        f"{counted(count, 'picture')}, {counted(tags, 'tag')}, {1e3 * work.own_s / count:.1f} ms a picture; "
        f"the library with its defaults: {counted(work.library_tags, 'tag')}, "
        f"{1e3 * work.library_s / count:.1f} ms"
    )
    if _any_pose(work.pictures):
        text += f"\nstandard deviation of a corner's coordinate: {corner_sigma_px(work.pictures):.2f} px"
    return text


def _report(work: _Work) -> dict[str, Any]:
    from msrr_perception.photographs.reading import corner_sigma_px, covariance_factor

    factor = covariance_factor(work.pictures)
    images = [
        {
            "file": picture.name,
            "width": picture.width,
            "height": picture.height,
            "detections": [_detection(found, poses, factor) for found, poses in picture.tags],
        }
        for picture in work.pictures
    ]
    count = max(len(work.pictures), 1)
    return {
        "corner_sigma_px": corner_sigma_px(work.pictures),
        "ms_per_picture": 1e3 * work.own_s / count,
        "library_ms_per_picture": 1e3 * work.library_s / count,
        "images": images,
    }


def _detection(found: FoundTag, poses: Sequence[TagPose], factor: float) -> dict[str, Any]:
    """Return a tag as JSON; ``factor`` is what the covariances are multiplied by."""
    tag = found.tag
    return {
        "tag_id": tag.tag_id,
        "family": found.family,
        "corners": tag.corners.tolist(),
        "corner_sigma_px": None if tag.corner_sigma_px is None else tag.corner_sigma_px.tolist(),
        "decision_margin": tag.decision_margin,
        "hamming": tag.hamming,
        "refined": found.refined,
        "search": found.search,
        "poses": [
            {
                "R_CT": pose.X_CT.R.tolist(),
                "p_CT_m": pose.X_CT.p.tolist(),
                "yaw_deg": _yaw_deg(pose),
                "reprojection_px": pose.reprojection_px,
                "covariance": (factor * pose.covariance).tolist(),
            }
            for pose in poses
        ],
    }
