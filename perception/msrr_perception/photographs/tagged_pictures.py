"""The tags of pictures and films that one calibrated camera took, for a map of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from msrr_perception.detection.detector import Detector
from msrr_perception.mapping.mapper import TaggedPicture
from msrr_perception.photographs.picture_files import PictureError, Repeats, read_pictures
from msrr_scenes.geometry.lens import Lens


def picture_names(files: Sequence[Path]) -> dict[Path, str]:
    """Return a name for each file: its own without the ending, with folders where others share it."""
    names: dict[Path, str] = {}
    alike, parts = list(files), 1
    while alike:
        found = {file: file.stem if parts == 1 else "/".join(file.parts[-parts:]) for file in alike}
        counts = Counter(found.values())
        names |= {file: name for file, name in found.items() if counts[name] == 1}
        alike, parts = [file for file in found if file not in names], parts + 1
    return names


def tagged_pictures(
    files: Sequence[Path],
    detector: Detector,
    lens: Lens,
    on_repeat: Callable[[str, str], None] = lambda name, first: None,
) -> Iterator[TaggedPicture]:
    """Yield the tags of one picture after the other; one that is there twice tells nothing the second time.

    ``on_repeat`` is called with the name of a picture, or of a frame of a film, whose pixels are those of an
    earlier one, and with the name of that. The detector is that for the lens of all pictures.

    Raises:
        PictureError: A file cannot be read, or is not of the size that the lens was calibrated for.
    """
    frame, names, repeats = lens.camera.frame, picture_names(files), Repeats()
    for file in files:
        for name, pixels in read_pictures(file):
            if pixels.shape != (frame.height, frame.width):
                height, width = pixels.shape
                raise PictureError(
                    f"{name}: {width} x {height} px, but the calibration is of {frame.width} x {frame.height}"
                    " px; calibrate with pictures of this size"
                )
            first = repeats.first(name, pixels)
            if first is not None:
                on_repeat(name, first)
                continue
            yield TaggedPicture(names[file] + name.removeprefix(str(file)), detector.detect(pixels, frame))
