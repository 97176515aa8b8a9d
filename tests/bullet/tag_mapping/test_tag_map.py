"""Maps of a made-up room from rendered pictures and real detection: tags on two walls and on a board."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pybullet
import pytest
import yaml

from msrr_bullet.bench.renderer_scenes import empty_client
from msrr_bullet.cli.app import run
from msrr_bullet.render import Instant, RenderContext, build_renderer
from msrr_bullet.render.raster_renderer import RasterRenderer
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.simulation.tag_plates import load_tag_plate
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.mapping.mapper import TaggedPicture, TagMap, map_tags
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import IDEAL_LENS, Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera, optical_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.loading.calibration_file import read_calibration
from msrr_scenes.loading.tag_map_file import read_tag_map
from msrr_scenes.messages import Pixels
from msrr_scenes.specs.spec import Choice

Read = Callable[[str, Pixels], TaggedPicture]
Capture = pytest.CaptureFixture[str]

TAG_SIZE = 0.12
LENS = Lens(PinholeCamera(640, 480, 520.0, (3.0, -2.0)), Distortion(k1=-0.1, k2=0.02))
BLUR_PX, NOISE_GREY = 0.6, 2.0

#: Places [m] and yaws [rad] of tags: x right along the first wall, which y = 2 is, the second at x = 1.2.
PLACES = {
    0: (-0.9, 2.0, 1.2, 0.0),
    1: (-0.3, 2.0, 1.5, 0.0),
    2: (0.3, 2.0, 1.1, 0.0),
    3: (0.8, 2.0, 1.5, 0.0),
    4: (1.2, 1.6, 1.2, -1.5),
    5: (1.2, 1.0, 1.5, -1.5),
    6: (1.2, 0.6, 1.1, -1.6),
    7: (0.0, 1.7, 1.3, 0.3),
}

#: Places of the camera, and what it looks at [m].
STANDS = (
    ((-0.8, 0.6, 1.3), (-0.4, 2.0, 1.3)),
    ((0.1, 0.5, 1.6), (-0.2, 2.0, 1.3)),
    ((0.5, 0.7, 1.1), (0.3, 2.0, 1.3)),
    ((-0.2, 0.9, 1.4), (0.7, 2.0, 1.3)),
    ((-0.1, 0.6, 1.2), (1.1, 1.7, 1.3)),
    ((0.1, 0.5, 1.5), (1.2, 1.1, 1.3)),
    ((-0.1, 1.0, 1.2), (1.2, 0.9, 1.3)),
    ((-0.6, 0.4, 1.5), (0.9, 1.6, 1.3)),
)


def tag_pose(x: float, y: float, z: float, yaw: float) -> SE3:
    """Return the pose of a tag on a wall: at yaw 0 it is read from -y."""
    return optical_pose(SE3.from_xyz_rpy([x, y, z], [0.02, 0.0, 0.5 * math.pi + yaw]))


def camera_pose(stand: tuple[tuple[float, ...], tuple[float, ...]], roll: float) -> SE3:
    place, aim = np.array(stand[0]), np.array(stand[1])
    dx, dy, dz = aim - place
    pitch = -math.atan2(dz, math.hypot(dx, dy))
    return optical_pose(SE3.from_xyz_rpy(place, [roll, pitch, math.atan2(dy, dx)]))


@dataclass
class Room:
    """The rendered room."""

    client: int
    bodies: dict[int, int]
    renderer: RasterRenderer

    def photograph(self, number: int) -> Pixels:
        noise = ImageNoise(number + 1, BLUR_PX, NOISE_GREY)
        X_WC = camera_pose(STANDS[number], 0.1 * (-1) ** number)
        window = LENS.camera.frame.padded(noise.margin)
        views = [(window, Instant(X_WC))]
        (ideal,) = self.renderer.render_instants(LENS.camera, views, LENS.distortion)
        return noise.read_out(ideal, LENS.camera.frame, number)

    def place(self, tag: int, X_WT: SE3) -> None:
        pose = X_WT.p.tolist(), X_WT.quaternion_xyzw().tolist()
        pybullet.resetBasePositionAndOrientation(self.bodies[tag], *pose, physicsClientId=self.client)


@pytest.fixture(scope="module")
def room() -> Iterator[Room]:
    with empty_client() as (client, folder):
        bodies = {
            tag: load_tag_plate(client, folder, tag, TAG_SIZE, tag_pose(*place))
            for tag, place in PLACES.items()
        }
        renderer = build_renderer(Choice(name="raster"), RenderContext(client))
        assert isinstance(renderer, RasterRenderer)
        yield Room(client, bodies, renderer)


@pytest.fixture(scope="module")
def read() -> Read:
    """Detect the tags of a picture."""
    detector = PupilDetector().for_lens(LENS)

    def tagged(name: str, pixels: Pixels) -> TaggedPicture:
        return TaggedPicture(name, detector.detect(pixels, LENS.camera.frame))

    return tagged


@pytest.fixture(scope="module")
def rendered(room: Room) -> dict[str, Pixels]:
    return {f"view_{i}": room.photograph(i) for i in range(len(STANDS))}


@pytest.fixture(scope="module")
def pictures(rendered: dict[str, Pixels], read: Read) -> list[TaggedPicture]:
    return [read(name, pixels) for name, pixels in rendered.items()]


def deviation(found: TagMap, tag: int) -> Array:
    """Return by how much a tag is off in the map's frame: place [m] and rotation [rad], shape (6,)."""
    X_MT = tag_pose(*PLACES[found.reference]).inverse() @ tag_pose(*PLACES[tag])
    R = X_MT.R @ found.tags[tag].X_MT.R.T
    return np.concatenate([X_MT.p - found.tags[tag].X_MT.p, cv2.Rodrigues(R)[0].ravel()])


def test_tags_are_where_they_hang(pictures: list[TaggedPicture]) -> None:
    """Within 3 mm and 0.3 deg over a room of 2 m, and as certain as the map says.

    The mean of seven chi-squared numbers with six degrees of freedom each lies below a third of its
    expectation, or above thrice, in one of 10^4 cases; corner errors that all pictures have in common add
    to it.
    """
    found = map_tags(pictures, LENS, TAG_SIZE)
    assert set(found.tags) == set(PLACES)
    assert not found.left_out
    assert not found.unconnected
    assert np.median(found.distances()) < 0.05
    others = [tag for tag in PLACES if tag != found.reference]
    errors = {tag: deviation(found, tag) for tag in others}
    assert max(np.linalg.norm(e[:3]) for e in errors.values()) < 0.003
    assert max(np.linalg.norm(e[3:]) for e in errors.values()) < math.radians(0.3)
    nees = [errors[t] @ np.linalg.solve(found.tags[t].covariance, errors[t]) for t in others]
    assert 2.0 < np.mean(nees) < 18.0


def test_neither_order_nor_names_matter(pictures: list[TaggedPicture]) -> None:
    """Other names change the order in which views are placed, and other ids that of tags."""
    found = map_tags(pictures, LENS, TAG_SIZE)
    renamed = [
        TaggedPicture(f"z{99 - i}", tuple(replace(t, tag_id=50 - t.tag_id) for t in reversed(p.tags)))
        for i, p in enumerate(reversed(pictures))
    ]
    again = map_tags(renamed, LENS, TAG_SIZE)
    X_MN = found.tags[50 - again.reference].X_MT
    for tag, mapped in found.tags.items():
        X = X_MN @ again.tags[50 - tag].X_MT
        np.testing.assert_allclose(X.matrix(), mapped.X_MT.matrix(), atol=1e-6)


def test_a_tag_that_moved_is_named(room: Room, read: Read) -> None:
    """Tag 4 is moved by 2 cm after half of the pictures; the map of the others is as good as without it."""
    x, y, z, yaw = PLACES[4]
    pictures = []
    try:
        for i in (3, 7, 4, 5, 6):
            if i == 4:
                room.place(4, tag_pose(x, y - 0.015, z + 0.013, yaw))
            pictures.append(read(f"view_{i}", room.photograph(i)))
    finally:
        room.place(4, tag_pose(x, y, z, yaw))
    pictures += [read(f"view_{i}", room.photograph(i)) for i in (0, 1, 2)]
    found = map_tags(pictures, LENS, TAG_SIZE)
    assert found.left_out
    assert {tag for left_out in found.left_out for tag in left_out.tags} == {4}
    others = [tag for tag in found.tags if tag not in (4, found.reference)]
    assert max(np.linalg.norm(deviation(found, tag)[:3]) for tag in others) < 0.004


def test_the_lens_is_found_as_well(pictures: list[TaggedPicture]) -> None:
    """From a calibration without distortion. Four standard deviations hold in all but 1 of 3000 cases."""
    guess = Lens(replace(LENS.camera, focal=530.0, offset=(0.0, 0.0)), IDEAL_LENS)
    found = map_tags(pictures, guess, TAG_SIZE, refine_lens=True)
    told = [
        found.lens.camera.focal,
        *found.lens.camera.offset,
        found.lens.distortion.k1,
        found.lens.distortion.k2,
    ]
    truth = [LENS.camera.focal, *LENS.camera.offset, LENS.distortion.k1, LENS.distortion.k2]
    assert np.all(np.abs(np.subtract(told, truth)) < 4.0 * np.array(found.lens_sigma))
    assert found.sigma_px < 0.05 < map_tags(pictures, guess, TAG_SIZE).sigma_px


@pytest.fixture
def folder(tmp_path: Path, rendered: dict[str, Pixels]) -> Path:
    """The pictures of the room as files, and the calibration of their camera beside."""
    for name, pixels in rendered.items():
        cv2.imwrite(str(tmp_path / f"{name}.png"), pixels)
    camera, lens = LENS.camera, LENS.distortion
    matrix = [camera.focal, 0.0, camera.cx, 0.0, camera.focal, camera.cy, 0.0, 0.0, 1.0]
    calibration = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_matrix": {"rows": 3, "cols": 3, "data": matrix},
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": [lens.k1, lens.k2, 0.0, 0.0, 0.0]},
    }
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(calibration))
    return tmp_path


def test_command_writes_map_residuals_and_figures(folder: Path, capsys: Capture) -> None:
    out = folder / "out"
    arguments = ["map", str(folder), "--calibration", str(folder / "camera.yaml"), "--refine-lens"]
    assert run([*arguments, "--tag-size", str(TAG_SIZE), "--out", str(out)]) == 0
    assert f"{len(PLACES)} tags in {len(STANDS)} pictures" in capsys.readouterr().out
    told = read_tag_map(out / "map.yaml")
    X_MW = tag_pose(*PLACES[told.reference]).inverse()
    for tag, mapped in told.tags.items():
        assert np.linalg.norm((X_MW @ tag_pose(*PLACES[tag])).p - mapped.X_MT.p) < 0.003
    assert len((out / "residuals.csv").read_text().splitlines()) == 1 + sum(
        t.pictures for t in told.tags.values()
    )
    for figure in ("map.png", "residuals.png"):
        assert cv2.imread(str(out / figure)).std() > 5.0
    refined = read_calibration(out / "camera.yaml")
    assert abs(refined.fx_px - LENS.camera.focal) < 2.0


def test_a_refined_lens_does_not_replace_the_calibration_it_began_from(folder: Path, capsys: Capture) -> None:
    out = folder / "out"
    out.mkdir()
    given = (folder / "camera.yaml").rename(out / "camera.yaml")
    before = given.read_bytes()
    arguments = ["map", str(folder), "--calibration", str(given), "--tag-size", str(TAG_SIZE)]
    assert run([*arguments, "--refine-lens", "--out", str(out)]) == 2
    assert "the command uses this file already" in capsys.readouterr().err
    assert given.read_bytes() == before


def test_command_says_what_a_large_residual_may_come_from(folder: Path, capsys: Capture) -> None:
    told = yaml.safe_load((folder / "camera.yaml").read_text())
    told["camera_matrix"]["data"][0] *= 1.3
    (folder / "wrong.yaml").write_text(yaml.safe_dump(told))
    arguments = ["--calibration", str(folder / "wrong.yaml"), "--tag-size", str(TAG_SIZE)]
    assert run(["map", str(folder), *arguments, "--out", str(folder / "out")]) == 0
    assert "--calibration or --tag-size, which all tags have, may be wrong" in capsys.readouterr().out


def test_command_names_what_is_wrong(folder: Path, capsys: Capture) -> None:
    def refused(*images: str, calibration: str = "camera.yaml") -> str:
        paths = [str(folder / image) for image in images]
        arguments = [
            "--calibration",
            str(folder / calibration),
            "--tag-size",
            "0.1",
            "--out",
            str(folder / "o"),
        ]
        assert run(["map", *paths, *arguments]) == 2
        return capsys.readouterr().err

    (folder / "empty.png").write_bytes(b"")
    (folder / "nothing").mkdir()
    cv2.imwrite(str(folder / "small.png"), np.zeros((48, 64), np.uint8))
    cv2.imwrite(str(folder / "black.png"), np.zeros((480, 640), np.uint8))
    assert "No such file" in refused("missing.png")
    assert "empty.png: the file is empty" in refused("empty.png")
    assert "no picture or film in this folder" in refused("nothing")
    assert "64 x 48 px, but the calibration is of 640 x 480 px" in refused("small.png")
    assert "no tag was found" in refused("black.png")
    assert "missing.yaml: cannot be read" in refused("black.png", calibration="missing.yaml")


@pytest.mark.nightly
def test_map_of_a_walk_past_real_tags(photographs: Path, tmp_path: Path, capsys: Capture) -> None:
    """With the calibration of the same camera by the pictures of its chessboard."""
    board = ["--board", "7x5", "--square-mm", "30"]
    assert run(["calibrate", str(photographs / "chessboard"), *board, "--out", str(tmp_path)]) == 0
    calibration = tmp_path / "camera.yaml"
    arguments = ["map", str(photographs / "mapping"), "--calibration", str(calibration), "--tag-size", "0.16"]
    assert run([*arguments, "--out", str(tmp_path)]) == 0
    told = re.search(r"corner residuals ([\d.]+) px \(median\)", capsys.readouterr().out)
    assert told is not None
    assert float(told[1]) < 0.5
