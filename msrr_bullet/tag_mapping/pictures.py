"""Grey pictures from image files, and the tags in them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from msrr_perception.detection.detector import Detector
from msrr_perception.mapping.mapper import TaggedPicture
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.messages import Pixels

#: Endings of the image files that are taken from a folder.
SUFFIXES = (".bmp", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp")


class PictureError(MsrrError):
    """A picture cannot be used."""


def image_files(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Return the image files among files and folders, each once and sorted.

    Raises:
        PictureError: A path does not exist, or a folder holds no image.
    """
    found: set[Path] = set()
    for path in paths:
        if not path.exists():
            raise PictureError(f"{path}: no such file or folder")
        inside = [f for f in path.iterdir() if f.suffix.lower() in SUFFIXES] if path.is_dir() else [path]
        if not inside:
            raise PictureError(f"{path}: no image in this folder; known endings: {', '.join(SUFFIXES)}")
        found.update(inside)
    return tuple(sorted(found))


def read_grey(path: Path) -> Pixels:
    """Return the grey pixels of an image file, shape (height, width), turned as its EXIF data say.

    Raises:
        PictureError: The file is no image that can be read.
    """
    data = np.fromfile(path, dtype=np.uint8)
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if len(data) else None
    except cv2.error as error:
        raise PictureError(f"{path}: the image cannot be read: {error.err}") from None
    if pixels is None:
        raise PictureError(f"{path}: not an image, or a damaged one; leave it out")
    return np.asarray(pixels, dtype=np.uint8)


def picture_names(files: Sequence[Path]) -> dict[Path, str]:
    """Return a name for each file: its own without the ending, with its folder's if others have that one."""
    stems = [file.stem for file in files]
    return {
        file: file.stem if stems.count(file.stem) == 1 else f"{file.parent.name}/{file.name}"
        for file in files
    }


def tagged_pictures(files: Sequence[Path], detector: Detector, lens: Lens) -> Iterator[TaggedPicture]:
    """Yield the tags of one image file after the other.

    Args:
        files: The image files.
        detector: Detector for that lens.
        lens: Lens of all pictures.

    Raises:
        PictureError: A file is no image, or not of the size that the lens was calibrated for.
    """
    frame, names = lens.camera.frame, picture_names(files)
    for file in files:
        pixels = read_grey(file)
        if pixels.shape != (frame.height, frame.width):
            height, width = pixels.shape
            raise PictureError(
                f"{file}: {width} x {height} px, but the calibration is of {frame.width} x {frame.height}"
                " px; calibrate with pictures of this size"
            )
        yield TaggedPicture(names[file], detector.detect(pixels, frame))
