"""The page of photographs: a walk past real tags, and the same views of the mapped tags rendered.

python docs/make_photographs.py PICTURES CALIBRATION TAG_SIZE
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from photograph_light import Light, edges_of, fit_light, fit_noise
from photograph_terms import terms
from photograph_text import TEXT

from msrr_bullet.bench.renderer_scenes import empty_client
from msrr_bullet.render import Instant, RenderContext, build_renderer
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.simulation.tag_plates import load_tag_plate
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.mapping.mapper import TaggedPicture, TagMap, map_tags
from msrr_perception.photographs.picture_files import picture_files, read_picture
from msrr_perception.photographs.tagged_pictures import picture_names
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import R_BODY_OPTICAL
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.loading.calibration_file import read_calibration
from msrr_scenes.messages import Pixels
from msrr_scenes.specs.sensors import CameraSpec
from msrr_scenes.specs.spec import Choice

PAGE = Path(__file__).resolve().parent / "results" / "photographs.md"

#: Upper ends of the classes of the size of tags [px].
SIZES_PX = (0, 25, 40, 55, 70, 1000)

#: Least size and largest angle of a mapped tag that is looked for; its white border has to be in the frame.
LEAST_EDGE_PX, LARGEST_ANGLE, PLATE = 12.0, math.radians(75.0), 1.25

#: The map stands this high above the floor, so that the floor hides none of it [m].
HEIGHT_M = 3.0

#: Blur of the first rendering, by which that of the lens is found [px], and instants of an exposure.
FIRST_BLUR_PX, INSTANTS = 0.5, 8

#: Least blur that is tried [px].
LEAST_BLUR_PX = 0.1

#: Rows of the table of what was measured.
ROWS = [
    "tags found, of those that the map shows in the frame",
    "corner residuals: median, RMS [px] (tags)",
    *(f"... of tags of {low} to {high} px" for low, high in pairwise(SIZES_PX)),
    "width of edges [px]: 5, 50, 95 %",
    "decision margin: 5, 50, 95 %",
]


@dataclass
class Column:
    """One column of the page."""

    pictures: list[TaggedPicture]
    found: TagMap
    widths: Array  # of all edges [px]
    margins: Array


class Darkroom:
    """Renders the mapped tags as the photographs show them."""

    def __init__(self, found: TagMap, client: int, folder: Path) -> None:
        self.lens, self.found = found.lens, found
        self.X_WM = SE3(R_BODY_OPTICAL, [0.0, 0.0, HEIGHT_M])
        for tag, mapped in found.tags.items():
            load_tag_plate(client, folder, tag, found.tag_size, self.X_WM @ mapped.X_MT)
        renderer = build_renderer(Choice(name="raster"), RenderContext(client))
        assert isinstance(renderer, RasterRenderer)
        self.renderer = renderer

    def render(self, name: str, light: Light, noise: ImageNoise, frame: int) -> Pixels:
        """Return a view with the light, the motion and the noise of its photograph."""
        camera = self.lens.camera
        window = camera.frame.padded(noise.margin)
        X_WC = self.X_WM @ self.found.X_CM[name].inverse()
        turn = np.array([-light.smear[1], light.smear[0], 0.0]) / camera.focal
        shares = (np.arange(INSTANTS) + 0.5) / INSTANTS - 0.5
        turned = [X_WC @ SE3(cv2.Rodrigues(s * turn)[0], np.zeros(3)) for s in shares]
        views = [(window, Instant(X)) for X in turned]
        ideal = np.mean(self.renderer.render_instants(camera, views, self.lens.distortion), axis=0)
        low, high = np.percentile(ideal, 0.01), ideal.max()
        scaled = light.black + (ideal - low) * (light.white - light.black) / (high - low)
        return noise.read_out(np.rint(np.clip(scaled, 0.0, 255.0)).astype(np.uint8), camera.frame, frame)


def column(pictures: list[TaggedPicture], pixels: dict[str, Pixels], lens: Lens, size: float) -> Column:
    """Map the tags of some pictures, and measure their edges."""
    widths = [e[1] for p in pictures for t in p.tags for e in edges_of(pixels[p.name], t.corners)]
    margins = [t.decision_margin for p in pictures for t in p.tags]
    return Column(
        pictures, map_tags(pictures, lens, size, refine_lens=True), np.array(widths), np.array(margins)
    )


def looked_for(found: TagMap) -> list[tuple[str, int]]:
    """Return picture and tag of all that the map shows large enough and not too slanted."""
    square, camera = tag_corners(found.tag_size), found.lens.camera
    expected = []
    for name, X_CM in found.X_CM.items():
        for tag, mapped in found.tags.items():
            X_CT = X_CM @ mapped.X_MT
            corners_C = X_CT.act(square)
            cosine = X_CT.R[:, 2] @ X_CT.p / np.linalg.norm(X_CT.p)
            if corners_C[:, 2].min() < 0.1 or cosine < math.cos(LARGEST_ANGLE):
                continue
            edge = np.linalg.norm(np.diff(camera.project(corners_C), axis=0), axis=1).min()
            if (
                edge >= LEAST_EDGE_PX
                and found.lens.shows(camera.project(X_CT.act(PLATE * square)), 1.0).all()
            ):
                expected.append((name, tag))
    return expected


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (columns, ["---"] * len(columns), *rows))


def residuals(c: Column, low: float, high: float) -> str:
    """Return median and root mean square of the residuals of tags of some sizes, and the number of tags."""
    chosen = [s.distances for s in c.found.sightings if s.kept and low <= s.edge_px < high]
    if not chosen:
        return "-"
    return f"{np.median(chosen):.3f}, {math.sqrt(np.mean(np.square(chosen))):.3f} ({len(chosen)})"


def cells(c: Column, expected: list[tuple[str, int]]) -> list[str]:
    """Return the column of the table of what was measured."""
    seen = {(p.name, t.tag_id) for p in c.pictures for t in p.tags}
    found = sum(e in seen for e in expected)
    sizes = [(SIZES_PX[0], SIZES_PX[-1]), *pairwise(SIZES_PX)]
    spread = [
        ", ".join(f"{v:.2f}" for v in np.percentile(values, (5, 50, 95))) for values in (c.widths, c.margins)
    ]
    return [
        f"{found} of {len(expected)} ({found / len(expected):.1%})",
        *(residuals(c, *s) for s in sizes),
        *spread,
    ]


def named(found: TagMap) -> str:
    """Return in words what was left out of a map."""
    where = {"tag": "all pictures", "sighting": "one picture"}
    each = [
        "one picture" if x.kind == "picture" else f"tag {x.tags[0]} in {where[x.kind]}"
        for x in found.left_out
    ]
    return "; ".join(each) or "nothing"


def page(photographed: Column, calibrated: TagMap, plain: TagMap, rendered: Column, sensor: str) -> str:
    """Return the page."""
    expected = looked_for(photographed.found)
    both = zip(ROWS, cells(photographed, expected), cells(rendered, expected), strict=True)
    explained = [
        [t.name, str(t.numbers), f"{t.sigma_px:.3f}", "" if math.isnan(t.ratio) else f"{t.ratio:.1f}"]
        for t in terms(plain)
    ]
    camera, distortion = plain.lens.camera, plain.lens.distortion
    names = (
        ("library's corners, lens as calibrated", calibrated),
        ("library's corners, lens refined", plain),
        ("refined corners, lens refined", photographed.found),
    )
    maps = [
        [name, f"{np.median(m.distances()):.2f}, {math.sqrt(np.mean(m.distances() ** 2)):.2f}", named(m)]
        for name, m in names
    ]
    return TEXT.format(
        size=plain.tag_size,
        pictures=len(photographed.pictures),
        tags=sum(len(p.tags) for p in photographed.pictures),
        maps=table(["map from", "residuals: median, RMS [px]", "left out"], maps),
        lens=f"focal length {camera.focal:.1f} px, k1 {distortion.k1:.3f}, k2 {distortion.k2:.3f}",
        explained=table(["term", "numbers", "sigma left [px]", "F"], explained),
        sensor=sensor,
        both=table(["", "photographed", "rendered"], list(both)),
    )


def main(
    folder: Annotated[Path, typer.Argument(exists=True, file_okay=False, metavar="PICTURES")],
    calibration: Annotated[Path, typer.Argument(exists=True, dir_okay=False)],
    size: Annotated[float, typer.Argument(min=0.001, metavar="TAG_SIZE")],
) -> None:
    """Measure, render, and write the page."""
    told = read_calibration(calibration)
    lens = CameraSpec(width_px=told.width_px, height_px=told.height_px, calibration=told).lens
    pixels = {name: read_picture(file) for file, name in picture_names(picture_files([folder])).items()}
    detector, frame = PupilDetector().for_lens(lens), lens.camera.frame
    pictures = [TaggedPicture(n, detector.detect(p, frame)) for n, p in pixels.items()]
    library = PupilDetector(refine=False)
    raw = [TaggedPicture(n, library.detect(p, frame)) for n, p in pixels.items()]
    photographed = column(pictures, pixels, lens, size)
    plain = map_tags(raw, lens, size, refine_lens=True)
    lights = {p.name: fit_light(pixels[p.name], p) for p in pictures if p.name in photographed.found.X_CM}
    known = {name: light for name, light in lights.items() if light is not None}
    noise, blur = fit_noise(list(pixels.values())), FIRST_BLUR_PX
    sharp = float(np.median([light.width for light in known.values()]))
    with empty_client() as (client, plates):
        room = Darkroom(photographed.found, client, plates)
        for _ in range(2):
            camera = ImageNoise(1, blur, *noise)
            drawn = {n: room.render(n, light, camera, i) for i, (n, light) in enumerate(known.items())}
            again = [TaggedPicture(n, detector.detect(p, frame)) for n, p in drawn.items()]
            widths = [fit_light(drawn[p.name], p) for p in again]
            own = float(np.median([w.width for w in widths if w is not None]))
            used, blur = blur, math.sqrt(max(blur**2 + sharp**2 - own**2, LEAST_BLUR_PX**2))
    moved = np.percentile([float(np.linalg.norm(light.smear)) for light in known.values()], (50, 90, 100))
    sensor = (
        f"blur of the lens {used:.2f} px, read noise {noise[0]:.1f}, shot noise {noise[1]:.1f} grey levels,\n"
        f"motion of the image {moved[0]:.1f}, {moved[1]:.1f} and {moved[2]:.1f} px (median, 90 %, most)"
    )
    rendered = column(again, drawn, lens, size)
    PAGE.write_text(page(photographed, map_tags(raw, lens, size), plain, rendered, sensor), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
