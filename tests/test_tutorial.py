"""The tutorial "From your camera to a scene" works: its commands and its scene, on rendered pictures."""

from __future__ import annotations

import json
import math
import re
import shlex
import tempfile
from pathlib import Path

import cv2
import matplotlib
import numpy as np
import pytest

from msrr_bullet.bench.renderer_scenes import empty_client
from msrr_bullet.cli.app import run
from msrr_bullet.render import Instant, RenderContext, build_renderer
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.simulation.tag_plates import load_tag_plate
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_perception.detection.detector import PupilDetector
from msrr_scenes.arrays import Array
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry, marker_links
from msrr_scenes.loading.calibration_file import read_calibration, write_calibration
from msrr_scenes.loading.load import load_scene
from msrr_scenes.loading.tag_map_file import read_tag_map, write_tag_map
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CalibrationSpec
from msrr_scenes.specs.spec import Choice
from msrr_scenes.specs.tag_map import MappedTagSpec, TagMapSpec

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "tutorials" / "own_camera.md").read_text()
COMMANDS = [
    shlex.split(line)
    for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    for line in block.splitlines()
]
(SCENE,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)

LENS = Lens(PinholeCamera(640, 480, 430.0, (4.0, -3.0)), Distortion(k1=-0.08))

#: Commands that take as long as many trials; their options are checked with those of all pages.
LONG = ("sweep", "tolerance")


def photograph(client: int, middle: Array, places: Array, folder: Path) -> None:
    """Write pictures of what is at a place in the world, by a camera at some others [m]."""
    folder.mkdir()
    renderer = build_renderer(Choice(name="raster"), RenderContext(client))
    assert isinstance(renderer, RasterRenderer)
    for i, place in enumerate(places):
        dx, dy, dz = middle + np.array([0.0, 0.03, 0.02]) * math.cos(2.0 * i) - place
        angles = [0.2 * math.sin(3.0 * i), -math.atan2(dz, math.hypot(dx, dy)), math.atan2(dy, dx)]
        noise = ImageNoise(i + 1, 0.6, 2.0)
        views = [
            (LENS.camera.frame.padded(noise.margin), Instant(optical_pose(SE3.from_xyz_rpy(place, angles))))
        ]
        (ideal,) = renderer.render_instants(LENS.camera, views, LENS.distortion)
        cv2.imwrite(str(folder / f"{i:02d}.png"), noise.read_out(ideal, LENS.camera.frame, i))


def places_about(middle: Array, count: int, near: float, far: float, rise: float) -> Array:
    """Return places in front of what is seen from -x, shape (N, 3) [m].

    Args:
        middle: Middle of what is seen, shape (3,) [m].
        count: Number of places.
        near: Distance of the first place [m].
        far: Distance of the last place [m].
        rise: Share of the angles of up to 35 degrees that is left of those up and down.
    """
    angles = np.arange(count) * 2.4
    lean = np.radians(np.where(np.arange(count) % 3, 35.0, 20.0))
    up = rise * np.sin(lean) * np.sin(angles)
    side = np.stack([-np.cos(lean), np.sin(lean) * np.cos(angles), up], axis=1)
    return np.asarray(middle + np.linspace(near, far, count)[:, np.newaxis] * side)


def photograph_board(folder: Path) -> None:
    middle = np.array([1.0, 0.0, 0.6])
    X_WB = optical_pose(SE3(np.eye(3), middle))
    with empty_client() as (client, files):
        for tag in range(12):
            row, column = divmod(tag, 4)
            place = np.array([0.08 * (column - 1.5), 0.08 * (row - 1.0), 0.0])
            load_tag_plate(client, files, tag, 0.05, X_WB @ SE3(np.eye(3), place))
        photograph(client, middle, places_about(middle, 14, 0.32, 0.45, 1.0), folder)


def photograph_marker(folder: Path) -> UnitGeometry:
    """Photograph the rear marker of a unit that is not as designed, and return where its tags are."""
    errors = {
        "x_m": {"sigma": 5e-4},
        "y_m": {"sigma": 5e-4},
        "z_m": {"sigma": 5e-4},
        "yaw_deg": {"sigma": 1.0},
    }
    scene = Scene.model_validate(
        {
            "name": "built",
            "units": {"b": {"number": 1}, "a": {"number": 0, "pose": {"x_m": -1.5}}},
            "plan": [{"unit": "a", "to": "b.rear"}],
            "tags": {"side_m": 0.04},
            "as_built": {"tags": errors},
        }
    )
    built = draw_as_built(scene, 3)
    placement = Placement({unit: spec.pose.nominal for unit, spec in scene.units.items()}, {})
    geometry = built.units["b"].geometry
    middle = np.mean([geometry.frame(slot).p for slot in marker_links("rear")], axis=0)
    with tempfile.TemporaryDirectory() as files:
        tags = TagVisuals(scene, Path(files), built)
        with BulletWorld(scene, placement, tags=tags, built=built) as world:
            photograph(world.client, middle, places_about(middle, 14, 0.22, 0.40, 0.2), folder)
    return geometry


def test_the_board_to_print_is_that_of_the_tutorial(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sheet has the ids, the edges and the distances that the tutorial gives to ``msrr calibrate``."""
    page = (Path(__file__).resolve().parents[1] / "docs" / "how-to" / "calibration.md").read_text()
    (text,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(matplotlib.rcParams, "pdf.compression", 0)
    monkeypatch.setitem(matplotlib.rcParams, "savefig.dpi", 300)  # images are moved to whole pixels
    exec(compile(text.replace("board.pdf", "board.png"), "calibration.md", "exec"), {})
    placed = rb"([\d.]+) 0 0\s-([\d.]+) 0 [\d.]+ cm /I\d+ Do"  # width and height of an image in a PDF file
    drawn_pt = re.findall(placed, Path("marker.pdf").read_bytes())
    assert len(drawn_pt) == 3
    # A tag of 40 mm with the margin around it. They were 39.9 or 40.1 mm wide, by the pixels of a screen.
    np.testing.assert_allclose(25.4 / 72.0 * np.array(drawn_pt, dtype=float), 50.0, atol=1e-3)
    pixels = cv2.imread("board.png", cv2.IMREAD_GRAYSCALE)
    height, width = pixels.shape
    tags = sorted(PupilDetector().detect(pixels, Window(0, 0, width, height)), key=lambda tag: tag.tag_id)
    assert [tag.tag_id for tag in tags] == list(range(12))
    corners = np.array([tag.corners for tag in tags]) * 420.0 / width  # [mm], of the width of the sheet
    assert np.abs(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1) - 50.0).max() < 0.2
    places = corners.mean(axis=1).reshape(3, 4, 2)
    np.testing.assert_allclose(np.diff(places, axis=1), np.full((3, 3, 2), [80.0, 0.0]), atol=0.2)
    np.testing.assert_allclose(np.diff(places, axis=0), np.full((2, 4, 2), [0.0, 80.0]), atol=0.2)


def test_the_scene_of_the_tutorial_loads(tmp_path: Path) -> None:
    told = CalibrationSpec(
        fx_px=430, fy_px=430, cx_px=323.5, cy_px=236.5, k1=-0.08, width_px=640, height_px=480
    )
    write_calibration(tmp_path / "camera.yaml", told)
    drawn = load_scene("close_range").geometry("b")
    poses = {
        11 + i: MappedTagSpec(position_m=tuple(X.p), quaternion_xyzw=tuple(X.quaternion_xyzw()))
        for i, X in enumerate(drawn.frame(slot) for slot in marker_links("rear"))
    }
    (tmp_path / "measured").mkdir()
    found = TagMapSpec(family="tag36h11", tag_size_m=0.04, reference=11, tags=poses)
    write_tag_map(tmp_path / "measured" / "map.yaml", found)
    (tmp_path / "own.yaml").write_text(SCENE)
    scene = load_scene(tmp_path / "own.yaml")
    assert scene.cameras.onboard.calibration == told
    assert scene.units["b"].markers["rear"].map.tags.keys() == poses.keys()
    assert [words[1] for words in COMMANDS] == ["calibrate", "map", "check", "dock", *LONG]


@pytest.mark.nightly
def test_the_tutorial_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it measures is true to what the page says, and the unit docks by it."""
    monkeypatch.chdir(tmp_path)
    photograph_board(Path("boards"))
    true = photograph_marker(Path("marker"))
    Path("own.yaml").write_text(SCENE)
    for words in COMMANDS:
        if words[1] not in LONG:
            assert run(words[1:]) == 0, words
    told = read_calibration(Path("camera.yaml"))
    assert abs(told.fx_px - 430.0) < 0.002 * 430.0
    assert abs(told.cx_px - LENS.camera.cx) < 1.0
    assert abs(told.cy_px - LENS.camera.cy) < 1.0
    assert abs(told.k1 + 0.08) < 0.01
    found = read_tag_map(Path("measured/map.yaml"))
    slots = dict(zip((11, 12, 13), marker_links("rear"), strict=True))
    X_MU = true.frame(slots[found.reference]).inverse()
    for tag, slot in slots.items():
        off = (X_MU @ true.frame(slot)).p - found.tags[tag].X_MT.p
        assert np.linalg.norm(off) < 0.0005, (slot, off)
    assert json.loads(Path("runs/own/result.json").read_text())["outcome"] == "docked"
