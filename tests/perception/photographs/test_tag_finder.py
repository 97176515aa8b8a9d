from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from msrr_perception.detection.detector import PupilDetector
from msrr_perception.photographs.picture_files import picture_files, read_picture
from msrr_perception.photographs.tag_finder import TagFinder
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Pixels
from msrr_scenes.specs.tag_families import FAMILIES


def test_corners_are_those_of_the_picture(two_tags: Pixels, squares: dict[int, np.ndarray]) -> None:
    for found in TagFinder().find(two_tags):
        assert (found.family, found.refined, found.search) == ("tag36h11", True, "plain")
        assert np.abs(found.tag.corners - squares[found.tag.tag_id]).max() < 0.06


def test_blurred_tags_that_one_search_misses_are_found_by_two(
    two_tags: Pixels, squares: dict[int, np.ndarray]
) -> None:
    """Tags of 32 px with half the contrast, blurred by 1.5 px and by 6.5 px of motion upwards."""
    moved = cv2.blur(cv2.GaussianBlur(two_tags, (0, 0), 3.0), (1, 13))
    small = cv2.resize(moved, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    blurred = np.asarray(cv2.convertScaleAbs(small, None, 0.5, 40.0), dtype=np.uint8)
    window = Window(0, 0, blurred.shape[1], blurred.shape[0])
    assert PupilDetector(refine=False).detect(blurred, window) == ()
    found = TagFinder().find(blurred)
    assert [(f.tag.tag_id, f.search) for f in found] == [(3, "sharpened"), (7, "sharpened")]
    for f in found:
        right = 0.5 * (squares[f.tag.tag_id] + 0.5) - 0.5
        assert np.abs(f.tag.corners - right).max() < 2.0


def test_large_tags_that_are_out_of_focus_are_found(two_tags: Pixels, squares: dict[int, np.ndarray]) -> None:
    """Tags of 500 px, blurred by 6 px: the library finds them at half the resolution, and we did not."""
    large = cv2.GaussianBlur(cv2.resize(two_tags, None, fx=8.0, fy=8.0), (0, 0), 6.0)
    found = TagFinder().find(np.asarray(large, dtype=np.uint8))
    assert [(f.tag.tag_id, f.search) for f in found] == [(3, "coarse"), (7, "coarse")]
    for f in found:
        assert np.abs(f.tag.corners - (8.0 * (squares[f.tag.tag_id] + 0.5) - 0.5)).max() < 5.0


@pytest.mark.parametrize(
    ("family", "dictionary"),
    [
        ("tag16h5", cv2.aruco.DICT_APRILTAG_16h5),
        ("tag25h9", cv2.aruco.DICT_APRILTAG_25h9),
        ("tag36h11", cv2.aruco.DICT_APRILTAG_36h11),
    ],
)
def test_families_are_told_apart(family: str, dictionary: int) -> None:
    """A tag of one family, drawn by OpenCV, and searched for in three families at once."""
    tag = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(dictionary), 5, 96)
    picture = np.pad(tag, 40, constant_values=255)
    ours = ("tag16h5", "tag25h9", "tag36h11")
    (found,) = TagFinder(ours).find(picture)
    assert (found.family, found.tag.tag_id, found.refined) == (family, 5, True)
    edges = np.array([[39.5, 135.5], [135.5, 135.5], [135.5, 39.5], [39.5, 39.5]])
    for corner in found.tag.corners:
        assert np.abs(edges - corner).max(axis=1).min() < 0.1


@pytest.mark.nightly  # eight families, searched for twice
def test_every_family_can_be_searched_for(two_tags: Pixels) -> None:
    ids = [(f.family, f.tag.tag_id) for f in TagFinder(tuple(FAMILIES)).find(two_tags)]
    assert ids == [("tag36h11", 3), ("tag36h11", 7)]


def test_unknown_families_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'tag36h11'"):
        TagFinder(["tag36h1"])


def test_all_tags_of_the_walk_but_one_are_found_and_no_other(photographs: Path) -> None:
    lines = (photographs / "mapping" / "tags.txt").read_text().splitlines()
    truth = {name: sorted(map(int, ids)) for name, *ids in map(str.split, lines)}
    finder, missed = TagFinder(), 0
    for file in picture_files([photographs / "mapping"]):
        ids = [found.tag.tag_id for found in finder.find(read_picture(file))]
        assert len(set(ids)) == len(ids)
        assert set(ids) <= set(truth[file.name])
        missed += len(truth[file.name]) - len(ids)
    assert missed <= 1
