"""The files of a map: the map itself, the refined calibration, all residuals as CSV, and two figures."""

from __future__ import annotations

import csv
import math
from pathlib import Path

from msrr_bullet.tag_mapping.map_figure import draw_map
from msrr_bullet.tag_mapping.residual_figure import draw_residuals
from msrr_perception.mapping.mapper import TagMap
from msrr_scenes.geometry.distortion import COEFFICIENTS
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.loading.calibration_file import write_calibration
from msrr_scenes.loading.tag_map_file import write_tag_map
from msrr_scenes.specs.sensors import CalibrationSpec
from msrr_scenes.specs.tag_map import MappedTagSpec, TagMapSpec

#: Names of the files in the folder of a map.
MAP, CALIBRATION, RESIDUALS = "map.yaml", "camera.yaml", "residuals.csv"
MAP_FIGURE, RESIDUAL_FIGURE = "map.png", "residuals.png"


def write_results(folder: Path, tag_map: TagMap, family: str) -> list[Path]:
    """Write all files of a map into an existing folder and return them."""
    write_tag_map(folder / MAP, map_spec(tag_map, family))
    _write_residuals(folder / RESIDUALS, tag_map)
    files = [folder / MAP, folder / RESIDUALS]
    files += [draw_residuals(tag_map, folder / RESIDUAL_FIGURE), draw_map(tag_map, folder / MAP_FIGURE)]
    if tag_map.lens_sigma:
        write_calibration(folder / CALIBRATION, _calibration(tag_map.lens))
        files.append(folder / CALIBRATION)
    return files


def map_spec(tag_map: TagMap, family: str) -> TagMapSpec:
    """Return a map in the form of its file, rounded to what a file needs."""
    tags = {
        tag_id: MappedTagSpec(
            position_m=tuple(round(x, 6) for x in tag.X_MT.p.tolist()),
            quaternion_xyzw=tuple(round(x, 9) for x in tag.X_MT.quaternion_xyzw().tolist()),
            covariance=tuple(float(f"{x:.4g}") for x in tag.covariance.ravel().tolist()),
            pictures=tag.pictures,
        )
        for tag_id, tag in tag_map.tags.items()
    }
    return TagMapSpec(family=family, tag_size_m=tag_map.tag_size, reference=tag_map.reference, tags=tags)


def _write_residuals(path: Path, tag_map: TagMap) -> None:
    columns = ["picture", "tag", "edge_px", "angle_deg", "used"]
    columns += [f"{axis}{corner}_px" for corner in range(4) for axis in "uv"]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for s in tag_map.sightings:
            head = [s.picture, s.tag_id, f"{s.edge_px:.1f}", f"{math.degrees(s.angle):.1f}", int(s.kept)]
            writer.writerow(head + [f"{r:.3f}" for r in s.residuals.ravel()])


def _calibration(lens: Lens) -> CalibrationSpec:
    camera, distortion = lens.camera, lens.distortion
    return CalibrationSpec(
        fx_px=camera.focal,
        fy_px=distortion.aspect * camera.focal,
        cx_px=camera.cx,
        cy_px=camera.cy,
        **{name: float(getattr(distortion, name)) for name in COEFFICIENTS},
        width_px=camera.width,
        height_px=camera.height,
    )
