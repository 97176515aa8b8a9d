"""The tags of pictures and films that one calibrated camera took, for a map of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from msrr_perception.detection.detector import Detector
from msrr_perception.mapping.mapper import TaggedPicture
from msrr_perception.photographs.picture_files import PictureError, read_pictures
from msrr_scenes.geometry.lens import Lens


def picture_names(files: Sequence[Path]) -> dict[Path, str]:
    """Return a name for each file: its own without the ending, with its folder's if others have that one."""
    stems = [file.stem for file in files]
    return {
        file: file.stem if stems.count(file.stem) == 1 else f"{file.parent.name}/{file.name}"
        for file in files
    }


def tagged_pictures(files: Sequence[Path], detector: Detector, lens: Lens) -> Iterator[TaggedPicture]:
    """Yield the tags of one picture after the other.

    Args:
        files: Files of pictures and films.
        detector: Detector for that lens.
        lens: Lens of all pictures.

    Raises:
        PictureError: A file cannot be read, or is not of the size that the lens was calibrated for.
    """
    frame, names = lens.camera.frame, picture_names(files)
    for file in files:
        for name, pixels in read_pictures(file):
            if pixels.shape != (frame.height, frame.width):
                height, width = pixels.shape
                raise PictureError(
                    f"{name}: {width} x {height} px, but the calibration is of {frame.width} x {frame.height}"
                    " px; calibrate with pictures of this size"
                )
            yield TaggedPicture(names[file] + name.removeprefix(str(file)), detector.detect(pixels, frame))
