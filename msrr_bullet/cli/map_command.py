"""The command ``msrr map``: where real tags are, from pictures of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from msrr_bullet.cli.console import open_console, status_line
from msrr_bullet.cli.options import check_no_source, check_writable
from msrr_bullet.cli.picture_notes import poor_residual, same_picture
from msrr_scenes.errors import SceneError
from msrr_scenes.wording import counted

if TYPE_CHECKING:  # loaded by the command, so that msrr --help is quick
    from rich.console import Console
    from rich.table import Table

    from msrr_perception.mapping.mapper import LeftOut, MappedSighting, TagMap
    from msrr_scenes.geometry.lens import Lens

#: Upper ends of the classes of the size of tags in pictures [px], and of the angle of view [deg].
_SIZES_PX, _ANGLES_DEG = (25, 50, 75, 100), (15, 30, 45, 60)

#: Largest number of pictures in the table on the console, those with the largest residuals.
_SHOWN_PICTURES = 10


def map_pictures(
    images: Annotated[
        list[Path],
        typer.Argument(metavar="IMAGE...", help="Pictures, films, or folders of them, by one camera."),
    ],
    calibration: Annotated[Path, typer.Option(metavar="FILE", help="Calibration by OpenCV or ROS.")],
    tag_size: Annotated[
        float,
        typer.Option(metavar="M", min=1e-3, max=10.0, help="Edge of the black square of the tags [m]."),
    ],
    family: Annotated[str, typer.Option(help="Tag family.")] = "tag36h11",
    refine_lens: Annotated[
        bool, typer.Option("--refine-lens", help="Adjust focal length, principal point, k1 and k2 as well.")
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder of the map, its residuals and figures.")] = Path(
        "runs/map"
    ),
) -> None:
    """Find where tags are, from pictures of them.

    What contradicts the rest is named and left out.
    """
    lens = _lens(calibration)
    from msrr_bullet.run_folder import make_folder
    from msrr_bullet.tag_mapping.result_files import CALIBRATION, write_results
    from msrr_perception.detection.detector import PupilDetector
    from msrr_perception.mapping.mapper import map_tags
    from msrr_perception.photographs.picture_files import picture_files
    from msrr_perception.photographs.tagged_pictures import tagged_pictures

    files = picture_files(images)
    detector = PupilDetector(family).for_lens(lens)
    check_no_source(out, images)
    make_folder(out)
    if refine_lens:
        check_writable(out / CALIBRATION, "--out", [calibration])
    console = open_console()
    notes: list[str] = []
    with status_line(console, "reading the pictures") as show:
        pictures = []
        for picture in tagged_pictures(
            files, detector, lens, lambda *names: notes.append(same_picture(*names))
        ):
            pictures.append(picture)
            show(f"{counted(len(pictures), 'picture')} read")
        show("adjusting the map")
        found = map_tags(pictures, lens, tag_size, refine_lens=refine_lens)
    try:
        written = write_results(out, found, family)
    finally:
        _report(console, found, notes)
    typer.echo("files: " + ", ".join(map(str, written)))
    older = out / CALIBRATION
    if older not in written and older.exists() and not older.samefile(calibration):
        typer.echo(f"{older} is of an earlier run, and not of this map")


def _lens(calibration: Path) -> Lens:
    """Read a calibration.

    Raises:
        SceneError: The file is none, or does not say of which size its pictures were.
    """
    from msrr_scenes.loading.calibration_file import read_calibration

    told = read_calibration(calibration)
    if told.width_px is None or told.height_px is None:
        raise SceneError(f"{calibration}: image_width and image_height are needed")
    return told.lens(told.width_px, told.height_px)


def _report(console: Console, found: TagMap, notes: Iterable[str]) -> None:
    """Print the tags, the residuals by size, angle and picture, what was left out, and the refined lens."""
    from msrr_bullet.tag_mapping.residual_figure import headline

    used = [s for s in found.sightings if s.kept]
    worst = sorted({s.picture for s in used}, key=lambda name: -_rms(s for s in used if s.picture == name))
    console.print(_tags_table(found))
    console.print(_classes_table("by size of the tag [px]", used, _SIZES_PX, lambda s: s.edge_px))
    console.print(_classes_table("by angle [deg]", used, _ANGLES_DEG, lambda s: math.degrees(s.angle)))
    table = _residual_table("worst pictures")
    for name in worst[:_SHOWN_PICTURES]:
        _add_residuals(table, name, [s for s in used if s.picture == name])
    console.print(table)
    for note in notes:
        typer.echo(note)
    for left_out in found.left_out:
        typer.echo(_explained(left_out))
    for tag_id, tag in found.tags.items():
        if tag.may_be_turned is not None:
            typer.echo(
                f"tag {tag_id} may be turned by {math.degrees(tag.may_be_turned):.0f} degrees instead: the "
                "pictures show it nearly as well there; take some from other sides, or from nearer"
            )
    if found.unconnected:
        typer.echo(f"not connected with the map by any tag: {', '.join(found.unconnected)}")
    if found.lens_sigma:
        camera, distortion = found.lens.camera, found.lens.distortion
        values = (camera.focal, camera.cx, camera.cy, distortion.k1, distortion.k2)
        names = ("focal length [px]", "cx [px]", "cy [px]", "k1", "k2")
        terms = zip(names, values, found.lens_sigma, strict=True)
        typer.echo("lens: " + ", ".join(f"{name} {value:.4g} ± {sigma:.2g}" for name, value, sigma in terms))
    typer.echo(headline(found))
    for line in poor_residual(_rms(used), "--calibration or --tag-size, which all tags have,"):
        typer.echo(line)


def _tags_table(found: TagMap) -> Table:
    from rich.table import Table

    exact = "the tag size is" if found.lens_sigma else "the tag size and the calibration are"
    table = Table(
        title=f"Tags in the frame of tag {found.reference} (x right, y down, z into it)",
        title_justify="left",
        caption=f"±: standard deviation by the noise of the corners; {exact} taken as exact",
        caption_justify="left",
    )
    for column in ("tag", "pictures", "x [m]", "y [m]", "z [m]", "± [mm]", "± [deg]", "RMS [px]"):
        table.add_column(column, justify="right")
    for tag_id, tag in found.tags.items():
        x, y, z = (f"{value:z.4f}" for value in tag.X_MT.p.tolist())
        spread = f"{1e3 * tag.sigma_m:.2g}", f"{math.degrees(tag.sigma_rad):.2g}"
        rms = _rms(s for s in found.sightings if s.kept and s.tag_id == tag_id)
        table.add_row(str(tag_id), str(tag.pictures), x, y, z, *spread, f"{rms:.2f}")
    return table


def _classes_table(
    title: str,
    used: list[MappedSighting],
    ends: tuple[int, ...],
    value: Callable[[MappedSighting], float],
) -> Table:
    table = _residual_table(title)
    for low, high in zip((0, *ends), (*ends, math.inf), strict=True):
        name = f"{low} to {high}" if math.isfinite(high) else f"{low} and more"
        _add_residuals(table, name, [s for s in used if low <= value(s) < high])
    return table


def _residual_table(title: str) -> Table:
    from rich.table import Table

    table = Table(title=f"Corner residuals, {title}", title_justify="left")
    for column in ("", "tags", "median [px]", "RMS [px]", "95 % [px]"):
        table.add_column(column, justify="left" if not column else "right")
    return table


def _add_residuals(table: Table, name: str, sightings: list[MappedSighting]) -> None:
    from msrr_bullet.statistics import quantile

    distances = [d for s in sightings for d in s.distances.tolist()]
    if not distances:
        return
    median, high = (f"{quantile(distances, q):.2f}" for q in (0.5, 0.95))
    table.add_row(name, str(len(sightings)), median, f"{_rms(sightings):.2f}", high)


def _rms(sightings: Iterable[MappedSighting]) -> float:
    squares = [d * d for s in sightings for d in s.distances.tolist()]
    return math.sqrt(sum(squares) / max(len(squares), 1))


def _explained(left_out: LeftOut) -> str:
    """Return in words what was left out and what may be the reason."""
    pictures = ", ".join(left_out.pictures)
    what, why = {
        "sighting": (
            f"tag {left_out.tags[0]} in {pictures}",
            "blurred, partly covered, moved for this picture, or read on something else",
        ),
        "tag": (
            f"tag {left_out.tags[0]} in all of its pictures ({pictures})",
            "moved, bent, of another size, or one of two with this id",
        ),
        "picture": (f"picture {pictures}", "blurred, or by another camera"),
    }[left_out.kind]
    return f"left out: {what}: {left_out.rms_px:.2f} px from the rest ({left_out.score:.1f} sigma); {why}"
