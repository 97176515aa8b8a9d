"""Tag plates: the published bits, upright, one-sided, and textures that decode."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from msrr_bullet.render.floor import Floor
from msrr_bullet.render.renderer import RenderContext
from msrr_bullet.render.tiny_renderer import TinyRenderer
from msrr_bullet.simulation.tag_plates import load_tag_plate, plate_scale, write_plate
from msrr_bullet.tag_print import plate_texture
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.detection.native_apriltag import DetectorError, tag_bitmap
from msrr_scenes.geometry.mesh_points import obj_vertices
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.specs.tag_families import FAMILIES, TAG36H11

#: First codes of tag36h11 as AprilTag 2 lists them: 36 bits, row by row from the top left, 1 is white.
KNOWN_CODES = {0: 0xD5D628584, 1: 0xD97F18B49, 2: 0xDD280910E, 3: 0xE479E9C98, 4: 0xEBCBCA822}

CAMERA = PinholeCamera(320, 240, 300.0)
GREY = Floor(lambda: np.full((1, 1), 100.0, dtype=np.float32), 1.0, 100.0)


def upright_corners(h: float) -> np.ndarray:
    """Corners of a square about the origin in an image (y down): bottom left, then counter-clockwise."""
    return h * np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])


def look_at(X_WT: SE3, distance: float) -> SE3:
    """A camera straight in front of a tag, upright with it."""
    return X_WT @ SE3(np.eye(3), np.array([0.0, 0.0, -distance]))


@pytest.mark.parametrize(("tag_id", "code"), KNOWN_CODES.items())
def test_bitmaps_are_the_published_codes(tag_id: int, code: int) -> None:
    bits = np.array([int(b) for b in f"{code:036b}"], dtype=bool).reshape(6, 6)
    expected = np.pad(np.pad(bits, 1), 1, constant_values=True)
    np.testing.assert_array_equal(tag_bitmap("tag36h11", tag_id), expected)


def test_textures_decode_upright_and_unmirrored() -> None:
    """Half a turn would move the first corner to the top right."""
    detector = PupilDetector()
    for tag_id in range(0, 587, 13):
        image = cv2.resize(plate_texture(tag_id)[..., 0], (100, 100), interpolation=cv2.INTER_AREA)
        image = np.pad(image, 20, constant_values=100)
        (tag,) = detector.detect(image, Window(0, 0, 140, 140))
        assert (tag.tag_id, tag.hamming) == (tag_id, 0)
        np.testing.assert_allclose(tag.corners, 69.5 + upright_corners(40.0), atol=0.5)


@pytest.mark.parametrize("tag_id", [-1, 587])
def test_ids_outside_the_family_are_refused(tag_id: int) -> None:
    with pytest.raises(DetectorError, match=r"0 \.\. 586"):
        tag_bitmap("tag36h11", tag_id)


LARGEST = ("tagCircle49h12", "tagCustom48h12", "tagStandard52h13")


@pytest.mark.parametrize(
    "name", [pytest.param(f, marks=[pytest.mark.nightly] if f in LARGEST else []) for f in FAMILIES]
)
def test_every_family_is_rendered_and_detected(name: str, client: int, tmp_path: Path) -> None:
    """The last tag of a family, aslant: its id, the order of its corners, and where they are."""
    family = FAMILIES[name]
    X_WT = SE3.from_xyz_rpy([0.3, -0.2, 1.0], [0.4, -0.3, 0.7])
    load_tag_plate(client, tmp_path, family.ids - 1, 0.1, X_WT, family)
    X_TC = look_at(SE3.from_xyz_rpy([0.0, 0.0, 0.0], [0.4, -0.3, 0.2]), 0.4)
    image = TinyRenderer(RenderContext(client, 4, GREY)).render(CAMERA, X_WT @ X_TC, CAMERA.frame)
    (tag,) = PupilDetector(name).detect(image, CAMERA.frame)
    assert (tag.tag_id, tag.hamming) == (family.ids - 1, 0)
    expected = CAMERA.project(X_TC.inverse().act(tag_corners(0.1)))
    np.testing.assert_allclose(tag.corners, expected, atol=0.15)


def test_plate_is_a_quarter_larger_than_its_black_square(tmp_path: Path) -> None:
    mesh, texture = write_plate(tmp_path, 7)
    corners = obj_vertices(mesh) * plate_scale(0.08)
    np.testing.assert_allclose(corners, TAG36H11.plate_ratio * tag_corners(0.08), atol=1e-9)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
    assert normal[2] < 0.0  # the front faces z < 0
    assert texture.is_file()


def test_files_of_a_plate_that_were_cleared_are_written_again(tmp_path: Path) -> None:
    """A system clears temporary files that nobody has read for days, and a process may run for longer."""
    files = write_plate(tmp_path / "plates", 7)
    contents = [file.read_bytes() for file in files]
    for cleared in ([files[0]], [files[1]], files):
        for file in cleared:
            file.unlink()
        if cleared is files:
            (tmp_path / "plates").rmdir()
        assert write_plate(tmp_path / "plates", 7) == files
        assert [file.read_bytes() for file in files] == contents
    assert sorted((tmp_path / "plates").iterdir()) == sorted(files)


def test_the_plates_of_a_process_go_with_it() -> None:
    program = "from msrr_bullet.simulation.tag_plates import *; print(write_plate(plate_folder(), 7)[0])"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    mesh = Path(ran.stdout.strip())
    assert mesh.name == "tag36h11_7.obj"
    assert not mesh.parent.exists()


def test_a_free_plate_is_visible_from_the_front_only(client: int, tmp_path: Path) -> None:
    X_WT = SE3.from_xyz_rpy([0.3, -0.2, 1.0], [0.4, -0.3, 0.7])
    load_tag_plate(client, tmp_path, 123, 0.1, X_WT)
    renderer = TinyRenderer(RenderContext(client, 2, GREY))
    front = renderer.render(CAMERA, look_at(X_WT, 0.4), CAMERA.frame)
    (tag,) = PupilDetector().detect(front, CAMERA.frame)
    assert tag.tag_id == 123
    expected = CAMERA.project(tag_corners(0.1) + np.array([0.0, 0.0, 0.4]))
    np.testing.assert_allclose(tag.corners, expected, atol=0.3)
    behind = X_WT @ SE3.from_xyz_rpy([0.0, 0.0, 0.4], [0.0, np.pi, 0.0])
    assert PupilDetector().detect(renderer.render(CAMERA, behind, CAMERA.frame), CAMERA.frame) == ()


def test_threads_that_begin_together_have_one_folder() -> None:
    program = """
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from msrr_bullet.simulation.tag_plates import plate_folder
barrier = Barrier(8)
with ThreadPoolExecutor(8) as threads:
    print(len(set(threads.map(lambda _: barrier.wait() and None or plate_folder(), range(8)))))
"""
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert said == "1\n"
