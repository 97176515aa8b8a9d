"""Calibrations of cameras in files of OpenCV and of ROS, both in YAML, the former also in JSON.

Both name the same things alike: ``image_width``, ``image_height``, ``camera_matrix`` and
``distortion_coefficients``, the two matrices with ``rows``, ``cols`` and ``data``. A message ``CameraInfo``
of ROS is read as well, as ``ros2 topic echo --once`` or ``rostopic echo -n1`` prints it.

Source: what OpenCV's calibration sample writes by ``cv::FileStorage``; ``camera_calibration_parsers`` of ROS.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import Field, ValidationError, model_validator

from msrr_scenes.checks.problems import dotted
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.distortion import COEFFICIENTS
from msrr_scenes.geometry.lens import explained_fold
from msrr_scenes.loading.yaml_document import YamlDocument, parse_document, read_text
from msrr_scenes.specs.sensors import CalibrationSpec
from msrr_scenes.specs.spec import FileName, Spec, between
from msrr_scenes.whole_files import write_whole

#: Name of the model of Brown and Conrady in ROS; OpenCV names none.
_MODEL = "plumb_bob"

#: Mark of YAML 1.0 in the form of OpenCV, which no YAML reader accepts, and its tags of matrices.
_HEADER, _TAGS = "%YAML:1.0", ("!!opencv-matrix", "!!opencv-nd-matrix")

#: How other files begin that hold a calibration: XML of OpenCV, and ``ost.txt`` of ROS.
_NO_YAML = ("<?xml", "# oST")

#: What ROS prints after each message.
_END = "\n---"


class _Matrix(Spec, extra="ignore"):
    """A matrix, row by row."""

    rows: int = Field(ge=1, le=100)
    cols: int = Field(ge=1, le=100)
    data: tuple[Annotated[float, between(-1e9, 1e9)], ...] = Field(max_length=100)

    @model_validator(mode="before")
    @classmethod
    def _as_row(cls, data: Any) -> Any:
        """Return an array of one dimension, as OpenCV writes it since version 5, as a row."""
        match data:
            case {"sizes": [int(count)], **others}:
                return {**others, "rows": 1, "cols": count}
        return data


class _CalibrationFile(Spec, extra="ignore"):
    """What is read of a calibration file."""

    image_width: int = Field(ge=1, le=100_000)
    image_height: int = Field(ge=1, le=100_000)
    camera_matrix: _Matrix
    distortion_coefficients: _Matrix
    distortion_model: FileName = _MODEL
    fisheye_model: int = Field(default=0, ge=0, le=1)


def read_calibration(path: Path) -> CalibrationSpec:
    """Read the calibration of a camera from a file of OpenCV or of ROS.

    Args:
        path: The file.

    Raises:
        SceneError: The file cannot be read, is not such a file, or describes another model of a lens.
    """
    text = read_text(path).removeprefix(_HEADER)
    if text.lstrip().startswith(_NO_YAML):
        raise SceneError(
            f"{path}: a calibration of OpenCV or ROS is read as YAML or JSON; save it as camera.yaml"
        )
    for tag in _TAGS:
        text = text.replace(tag, "")
    document = parse_document(text.rstrip().removesuffix(_END), str(path))
    try:
        return _calibration(_CalibrationFile.model_validate(_as_file(document.data)), path)
    except ValidationError as error:
        raise SceneError(_explained(error, document)) from None


def _as_file(data: dict[str, Any]) -> dict[str, Any]:
    """Return a printed message ``CameraInfo`` under the keys of a file, and anything else as it is."""
    k, d = (data.get(key, data.get(key.upper())) for key in "kd")  # ROS 1 has capital letters
    if not (isinstance(k, list) and isinstance(d, list)):
        return data
    lens = d or [0.0] * len(COEFFICIENTS)
    return {
        "image_width": data.get("width"),
        "image_height": data.get("height"),
        "camera_matrix": {"rows": 3, "cols": 3, "data": k},
        "distortion_coefficients": {"rows": 1, "cols": len(lens), "data": lens},
        "distortion_model": data.get("distortion_model") or _MODEL,
    }


def write_calibration(path: Path, told: CalibrationSpec, form: Literal["ros", "opencv"] = "ros") -> None:
    """Write the calibration of a camera as :func:`read_calibration` reads it, without a loss.

    Args:
        path: The file to write.
        told: The calibration, with the size of the images.
        form: ``ros`` for what ``camera_info_manager`` reads, ``opencv`` for what ``cv::FileStorage`` reads.

    Raises:
        SceneError: The calibration does not say how large the images are.
    """
    if told.width_px is None or told.height_px is None:
        raise SceneError(f"{path}: a calibration is written with the size of its images, found none")
    coefficients = [getattr(told, name) for name in COEFFICIENTS]
    head = {"image_width": told.width_px, "image_height": told.height_px}
    matrices = {
        "camera_matrix": (3, 3, [told.fx_px, 0.0, told.cx_px, 0.0, told.fy_px, told.cy_px, 0.0, 0.0, 1.0]),
        "distortion_coefficients": (1, len(coefficients), coefficients),
    }
    text = _opencv_text(head, matrices) if form == "opencv" else _ros_text(head, matrices)
    write_whole(path, text)


def _opencv_text(head: dict[str, int], matrices: dict[str, tuple[int, int, list[float]]]) -> str:
    lines = [_HEADER, "---", *(f"{key}: {value}" for key, value in head.items())]
    for key, (rows, cols, data) in matrices.items():
        lines += [f"{key}: {_TAGS[0]}", f"   rows: {rows}", f"   cols: {cols}", "   dt: d"]
        lines.append(f"   data: [ {', '.join(map(repr, data))} ]")
    return "\n".join([*lines, ""])


def _ros_text(head: dict[str, int], matrices: dict[str, tuple[int, int, list[float]]]) -> str:
    fx, _, cx, _, fy, cy, *_ = matrices["camera_matrix"][2]
    rectification = (3, 3, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    projection = (3, 4, [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0])
    content: dict[str, Any] = {**head, "camera_name": "camera", "distortion_model": _MODEL}
    every = {**matrices, "rectification_matrix": rectification, "projection_matrix": projection}
    for key, (rows, cols, data) in every.items():
        content[key] = {"rows": rows, "cols": cols, "data": data}
    return yaml.safe_dump(content, sort_keys=False, default_flow_style=None)


def calibration_of(
    size: tuple[int, int], matrix: Sequence[float], coefficients: Sequence[float], model: str, name: str
) -> CalibrationSpec:
    """Return a calibration from the numbers of a message, such as ``CameraInfo`` of ROS.

    Args:
        size: Width and height of the pictures [px].
        matrix: Camera matrix K, row by row, 9 numbers.
        coefficients: Distortion k1, k2, p1, p2, k3; none for an ideal lens.
        model: Name of the model of the lens.
        name: Where the numbers come from, for messages.

    Raises:
        SceneError: The numbers are no calibration, or of another model.
    """
    message: dict[str, Any] = {"width": size[0], "height": size[1], "distortion_model": model}
    message |= {"k": [*matrix], "d": [*coefficients]}
    try:
        return _calibration(_CalibrationFile.model_validate(_as_file(message)), name)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise SceneError(f"{name}: {dotted(first['loc'])}: {first['msg']}") from None


def _calibration(file: _CalibrationFile, path: Path | str) -> CalibrationSpec:
    if file.distortion_model != _MODEL or file.fisheye_model:
        model = "fisheye" if file.fisheye_model else repr(file.distortion_model)
        raise SceneError(f"{path}: the lens has the model {model}; calibrate with {_MODEL!r}, which is known")
    matrix, lens = file.camera_matrix, file.distortion_coefficients
    if (matrix.rows, matrix.cols, len(matrix.data)) != (3, 3, 9):
        raise SceneError(f"{path}: camera_matrix: expected 3 x 3 numbers, found {_size(matrix)}")
    fx, skew, cx, left, fy, cy, *last = matrix.data
    if (skew, left, *last) != (0.0, 0.0, 0.0, 0.0, 1.0):
        text = "expected [fx, 0, cx, 0, fy, cy, 0, 0, 1]"
        raise SceneError(f"{path}: camera_matrix: {text}, found {list(matrix.data)}")
    known = len(COEFFICIENTS)
    count = len(lens.data)
    if 1 not in (lens.rows, lens.cols) or lens.rows * lens.cols != count or count < known - 1:
        text = f"expected one row or one column of {', '.join(COEFFICIENTS)}"
        raise SceneError(f"{path}: distortion_coefficients: {text}, found {_size(lens)}")
    if any(lens.data[known:]):
        text = f"only {', '.join(COEFFICIENTS)} are known, and there are further ones that are not zero"
        raise SceneError(f"{path}: distortion_coefficients: {text}; calibrate without them")
    told = CalibrationSpec(
        fx_px=fx,
        fy_px=fy,
        cx_px=cx,
        cy_px=cy,
        **dict(zip(COEFFICIENTS, lens.data, strict=False)),
        width_px=file.image_width,
        height_px=file.image_height,
    )
    fold = explained_fold(told.lens(file.image_width, file.image_height))
    if fold is not None:
        raise SceneError(f"{path}: distortion_coefficients: {fold}; calibrate with fewer coefficients")
    return told


def _size(matrix: _Matrix) -> str:
    return f"{matrix.rows} x {matrix.cols} with {len(matrix.data)} numbers"


def _explained(error: ValidationError, document: YamlDocument) -> str:
    """Return the first thing that is wrong with a file, with its place."""
    first = error.errors(include_url=False)[0]
    place, wrong = document.origin(first["loc"]), "required, and missing"
    if first["type"] != "missing":
        wrong = f"{first['msg'][0].lower()}{first['msg'][1:]}, found {first['input']!s:.60}"
    return f"{place}: {dotted(first['loc'])}: {wrong}; expected a calibration by OpenCV or ROS"
