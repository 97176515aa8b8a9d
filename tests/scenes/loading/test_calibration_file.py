"""Calibrations of cameras: as OpenCV and ROS write them, in a scene, and what is wrong with bad ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import pytest
import yaml

from msrr_scenes import load_scene, read_calibration, scene_hash
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.distortion import COEFFICIENTS, Distortion
from msrr_scenes.loading.calibration_file import write_calibration
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CalibrationSpec

K = [417.0, 0.0, 322.5, 0.0, 412.0, 236.0, 0.0, 0.0, 1.0]
LENS = [-0.2, 0.04, 0.001, -5e-4, 0.0]
COLUMN = np.array([LENS]).T


def ros(**changes: object) -> dict[str, object]:
    """What ``camera_calibration`` of ROS writes."""
    return {
        "image_width": 640,
        "image_height": 480,
        "camera_name": "head",
        "camera_matrix": {"rows": 3, "cols": 3, "data": K},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": LENS},
        "rectification_matrix": {"rows": 3, "cols": 3, "data": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
        "projection_matrix": {"rows": 3, "cols": 4, "data": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]},
    } | changes


def write(path: Path, content: object) -> Path:
    path.write_text(yaml.safe_dump(content))
    return path


def opencv(path: Path, lens: np.ndarray = COLUMN) -> Path:
    """What OpenCV's own calibration sample writes, with coefficients in a column."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", np.array(K).reshape(3, 3))
    storage.write("distortion_coefficients", lens)
    storage.write("avg_reprojection_error", 0.21)
    storage.release()
    return path


def test_files_of_opencv_and_ros_say_the_same(tmp_path: Path) -> None:
    in_yaml = opencv(tmp_path / "opencv.yaml")
    older = tmp_path / "older.yaml"  # OpenCV before version 5 marks its files as YAML 1.0 in a way of its own
    older.write_text("%YAML:1.0\n" + in_yaml.read_text().split("\n", 1)[1])
    marked = tmp_path / "marked.yaml"  # as some editors write UTF-8
    marked.write_text("\ufeff" + in_yaml.read_text(), encoding="utf-8")
    files = [write(tmp_path / "ros.yaml", ros()), in_yaml, older, marked, opencv(tmp_path / "opencv.json")]
    array = np.array(LENS)  # of one dimension, with a tag of its own since version 5
    files += [opencv(tmp_path / f"array.{form}", array) for form in ("yaml", "json")]
    for file in files:
        told = read_calibration(file)
        assert [told.fx_px, told.fy_px, told.cx_px, told.cy_px] == [417.0, 412.0, 322.5, 236.0]
        assert [getattr(told, key) for key in COEFFICIENTS] == LENS
        assert (told.width_px, told.height_px) == (640, 480)


@pytest.mark.parametrize(("k", "d"), [("k", "d"), ("K", "D")], ids=["ros2", "ros1"])
def test_a_message_as_ros_prints_it_says_the_same_as_the_file(tmp_path: Path, k: str, d: str) -> None:
    told = read_calibration(write(tmp_path / "ros.yaml", ros()))
    head = {"header": {"frame_id": "head"}, "height": 480, "width": 640}
    message = {**head, "distortion_model": "plumb_bob", k: K, d: LENS, "roi": {"do_rectify": False}}
    file = tmp_path / "message.yaml"
    file.write_text(yaml.safe_dump(message) + "---\n")
    assert read_calibration(file) == told
    ideal = read_calibration(write(file, message | {"distortion_model": "", d: []}))
    assert [getattr(ideal, key) for key in COEFFICIENTS] == [0.0] * len(COEFFICIENTS)
    with pytest.raises(SceneError, match=r"message\.yaml.*equidistant"):
        read_calibration(write(file, message | {"distortion_model": "equidistant"}))
    with pytest.raises(SceneError, match=r"message\.yaml.* image_height"):
        read_calibration(write(file, {key: message[key] for key in message if key != "height"}))
    with pytest.raises(SceneError, match=r"message\.yaml.* camera_matrix"):  # of an uncalibrated driver
        read_calibration(write(file, message | {k: [0.0] * 9}))


@pytest.mark.parametrize("form", ["ros", "opencv"])
def test_what_is_written_is_read_again_bit_for_bit(tmp_path: Path, form: Literal["ros", "opencv"]) -> None:
    """Thirty cameras with any digits, some of them as small as numbers in exponents.

    Coefficients are so small that none of these lenses folds its picture.
    """
    rng, file = np.random.default_rng(5), tmp_path / "camera.yaml"
    for _ in range(30):
        fx, fy, cx, cy = rng.uniform([300.0, 300.0, 200.0, 150.0], [1000.0, 1000.0, 440.0, 330.0]).tolist()
        digits = (rng.normal(size=5) * 10.0 ** rng.uniform(-12, -3, 5)).tolist()
        lens = dict(zip(COEFFICIENTS, digits, strict=True))
        told = CalibrationSpec(fx_px=fx, fy_px=fy, cx_px=cx, cy_px=cy, **lens, width_px=640, height_px=480)
        write_calibration(file, told, form)
        assert read_calibration(file) == told


def test_a_lens_that_folds_its_picture_is_refused(tmp_path: Path) -> None:
    """At k1 = -0.3 the corners show what is elsewhere as well: no ray belongs to such a pixel alone."""
    for k1, folds in ((-0.05, False), (-0.3, True), (-5.0, True)):
        told = CalibrationSpec(
            fx_px=417.0, fy_px=417.0, cx_px=319.5, cy_px=239.5, k1=k1, width_px=640, height_px=480
        )
        write_calibration(tmp_path / "camera.yaml", told)
        if folds:
            with pytest.raises(SceneError, match=r"camera\.yaml: distortion_coefficients: .* at one pixel"):
                read_calibration(tmp_path / "camera.yaml")
        else:
            assert read_calibration(tmp_path / "camera.yaml") == told


def test_opencv_itself_reads_what_is_written_for_it(tmp_path: Path) -> None:
    told = read_calibration(write(tmp_path / "ros.yaml", ros()))
    write_calibration(tmp_path / "opencv.yaml", told, "opencv")
    storage = cv2.FileStorage(str(tmp_path / "opencv.yaml"), cv2.FILE_STORAGE_READ)
    assert storage.getNode("camera_matrix").mat().ravel().tolist() == K
    assert storage.getNode("distortion_coefficients").mat().ravel().tolist() == LENS
    assert storage.getNode("image_width").real() == 640


def test_a_calibration_without_a_size_is_not_written(tmp_path: Path) -> None:
    told = CalibrationSpec(fx_px=400, fy_px=400, cx_px=320, cy_px=240)
    with pytest.raises(SceneError, match=r"camera\.yaml: .* size of its images"):
        write_calibration(tmp_path / "camera.yaml", told)


def scene_with(folder: Path, calibration: str) -> Path:
    """A scene file in a folder, with the calibration of its onboard camera."""
    file = folder / "own.yaml"
    file.write_text(
        "units:\n  b: {number: 1}\n  a: {number: 0, pose: {frame: b.rear, x_m: -0.5}}\n"
        f"plan: [{{unit: a, to: b.rear}}]\ncameras:\n  onboard:\n    calibration: {calibration}\n"
    )
    return file


def test_a_scene_holds_what_its_file_says(tmp_path: Path) -> None:
    """So a log, which holds the scene, can be replayed where the file is not."""
    write(tmp_path / "head.yaml", ros())
    scene = load_scene(scene_with(tmp_path, "head.yaml"))
    (tmp_path / "head.yaml").unlink()
    again = Scene.model_validate(json.loads(scene.model_dump_json()))
    lens = again.cameras.onboard.lens
    assert lens == scene.cameras.onboard.lens
    assert lens.camera.focal == 417.0
    assert (lens.camera.cx, lens.camera.cy) == (322.5, 236.0)
    assert lens.distortion == Distortion(-0.2, 0.04, 0.001, -5e-4, 0.0, aspect=412.0 / 417.0)


def test_a_file_and_the_same_numbers_are_the_same_scene(tmp_path: Path) -> None:
    write(tmp_path / "head.yaml", ros())
    numbers = "{fx_px: 417, fy_px: 412, cx_px: 322.5, cy_px: 236, k1: -0.2, k2: 0.04, p1: 0.001, p2: -0.0005"
    inline = scene_with(tmp_path, f"{numbers}, width_px: 640, height_px: 480}}")
    by_numbers = load_scene(inline)
    assert scene_hash(load_scene(scene_with(tmp_path, "head.yaml"))) == scene_hash(by_numbers)


def test_the_field_of_view_of_an_ideal_camera_is_a_short_form() -> None:
    ideal = load_scene("close_range").cameras.onboard
    f = ideal.pinhole.focal
    numbers = f"{{fx_px: {f!r}, fy_px: {f!r}, cx_px: 319.5, cy_px: 239.5}}"
    told = load_scene("close_range", {"cameras.onboard.calibration": numbers}).cameras.onboard
    assert told.lens == ideal.lens
    assert not told.lens.distorts


def test_errors_add_to_what_is_known() -> None:
    numbers = "{fx_px: 417, fy_px: 412, cx_px: 322.5, cy_px: 236, k1: -0.2, k2: 0.04}"
    errors = "{focal_percent: 1, cx_px: 3, k1: 0.02, p1: 0.001}"
    changes = {"cameras.onboard.calibration": numbers, "as_built": f"{{onboard: {errors}}}"}
    scene = load_scene("close_range", changes)
    true, told = draw_as_built(scene, 0).units["a"].camera, scene.cameras.onboard.lens
    assert true.pinhole.focal == pytest.approx(417.0 * 1.01)
    assert (true.pinhole.cx, true.pinhole.cy) == pytest.approx((325.5, 236.0))
    assert (true.distortion.k1, true.distortion.k2, true.distortion.p1) == pytest.approx((-0.18, 0.04, 0.001))
    assert true.distortion.aspect == told.distortion.aspect == 412.0 / 417.0


def test_a_calibration_of_another_size_is_not_taken_for_a_narrow_camera(tmp_path: Path) -> None:
    """A field of view of 0.2 degrees was named first, and not where it came from."""
    write(tmp_path / "head.yaml", ros())
    changes = {"cameras.onboard.width_px": 320, "cameras.onboard.calibration": str(tmp_path / "head.yaml")}
    with pytest.raises(SceneError, match="images with width_px = 640") as refused:
        load_scene("close_range", changes)
    assert "field of view" not in str(refused.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"image_width": 1280}, "images with width_px = 1280, and those of this camera have 640"),
        ({"distortion_model": "equidistant"}, "'equidistant'; calibrate with 'plumb_bob'"),
        ({"fisheye_model": 1}, "the lens has the model fisheye"),
        (
            {"camera_matrix": {"rows": 3, "cols": 3, "data": [*K[:4], float("nan"), *K[5:]]}},
            "data.4: .* finite",
        ),
        ({"camera_matrix": {"rows": 3, "cols": 3, "data": K[:8]}}, "3 x 3 with 8 numbers"),
        ({"camera_matrix": {"rows": 3, "cols": 3, "data": [417, 2, *K[2:]]}}, r"expected \[fx, 0, cx"),
        ({"camera_matrix": "none"}, "camera_matrix"),
        ({"camera_matrix": {"rows": 3, "cols": 3, "data": [-417, *K[1:]]}}, "fx_px"),
        ({"distortion_coefficients": {"rows": 1, "cols": 3, "data": LENS[:3]}}, "1 x 3 with 3 numbers"),
        ({"distortion_coefficients": {"rows": 1, "cols": 8, "data": [*LENS, 0.1, 0, 0]}}, "further ones"),
        (
            {"distortion_coefficients": {"rows": 1, "cols": 5, "data": [-0.2, 0, 0, 0, 0]}},
            "inverse up to about 34",
        ),
    ],
)
def test_a_file_that_is_not_the_calibration_of_the_camera_is_refused(
    tmp_path: Path, changes: dict[str, object], message: str
) -> None:
    write(tmp_path / "head.yaml", ros(**changes))
    with pytest.raises(SceneError, match=message) as refused:
        load_scene(scene_with(tmp_path, "head.yaml"))
    place, text = str(refused.value).split(": ", 1)
    assert "own.yaml:7:5" in place
    assert text.startswith("cameras.onboard.calibration: ")
    assert "\n" not in text


def test_an_array_that_is_too_short_is_refused_as_the_row_that_it_is(tmp_path: Path) -> None:
    file = opencv(tmp_path / "array.yaml", np.array(LENS[:3]))
    with pytest.raises(SceneError, match=r"row .* of k1, k2, p1, p2, k3, found (1 x 3|3 x 1) with 3 numbers"):
        read_calibration(file)


def test_a_file_that_lacks_something_is_refused_with_its_key(tmp_path: Path) -> None:
    content = ros()
    del content["distortion_coefficients"]
    write(tmp_path / "head.yaml", content)
    with pytest.raises(SceneError, match="distortion_coefficients: required, and missing"):
        read_calibration(tmp_path / "head.yaml")


@pytest.mark.parametrize("content", [b"\xff\xfe", b"[1, 2]", b"a: !!python/name:os.system x", b"a: [", b""])
def test_what_is_no_plain_yaml_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "head.yaml").write_bytes(content)
    with pytest.raises(SceneError, match=r"head\.yaml"):
        load_scene(scene_with(tmp_path, "head.yaml"))


def test_a_file_that_is_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"cameras\.onboard\.calibration: no file 'none\.yaml' beside"):
        load_scene(scene_with(tmp_path, "none.yaml"))


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ("{fx_px: 417, fy_px: 4.17, cx_px: 320, cy_px: 240}", "pixels are nearly square"),
        ("{fx_px: 4.17, fy_px: 4.17, cx_px: 320, cy_px: 240}", "it sees 178.5 deg along a row"),
        ("{fx_px: 417, fy_px: 417, cx_px: 320}", "cy_px: required"),
        ("{fx_px: 417, fy_px: 417, cx_px: 320, cy_px: 240, k4: 1}", "unknown key"),
    ],
)
def test_numbers_of_no_camera_are_refused(numbers: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        load_scene("close_range", {"cameras.onboard.calibration": numbers})


def test_a_known_lens_that_the_renderer_does_not_draw_is_refused() -> None:
    tiny = {
        "as_built": "perfect",
        "cameras.onboard.calibration": "{fx_px: 417, fy_px: 410, cx_px: 320, cy_px: 240}",
        "cameras.onboard.renderer": "tiny",
    }
    with pytest.raises(SceneError, match=r"draws ideal lenses only, and cameras\.onboard\.calibration"):
        load_scene("close_range", tiny)
    load_scene("close_range", tiny | {"cameras.onboard.calibration.fy_px": "417"})
