"""Boards for the calibration of a camera, and their points in a picture."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_perception.photographs.tag_finder import TagFinder
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError, UnknownNameError
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.messages import Pixels
from msrr_scenes.wording import counted

#: Fewest points of a board in a picture; fewer say nothing beside the pose of the board.
_FEWEST_POINTS = 6

#: Searches for a chessboard, the quicker one first.
_SEARCHES = (0, cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE)

#: Half of the window in which a corner of a chessboard is refined, over the distance of the nearest corner:
#: the window ends before the next one. On rendered boards this has a third less noise than the corners of the
#: search, whose focal length is half a percent too long.
_WINDOW = 0.4

#: Smallest half of that window [px], and when its search ends.
_LEAST_WINDOW_PX = 2
_SETTLED = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)

#: Largest RMS distance of the corners of tags from a grid in perspective, over the edges of the tags. The
#: distortion of a lens takes a tenth; tags of another grid are off by the distance from one to the next.
_MOST_MISFIT = 0.5

#: Prefix of the names of dictionaries in OpenCV.
_DICTIONARY = "DICT_"


#: The family of nearly all boards of AprilTags.
_USUAL_FAMILY = "tag36h11"


class BoardError(MsrrError):
    """A board that cannot be, or cannot be found."""


@dataclass(frozen=True, eq=False)
class BoardPoints:
    """Points of a board that were found in a picture.

    Attributes:
        points_B: The points in the frame of the board, shape (N, 3) [m]: x along its rows, y from row to row,
            and z = 0.
        corners: Where they are in the picture, shape (N, 2) [px].
    """

    points_B: Array
    corners: Array


class Board(Protocol):
    """A board of a known pattern.

    Attributes:
        uses_lens: Whether its points are found better if the lens is known.
    """

    uses_lens: bool

    def find(self, pixels: Pixels, lens: Lens | None = None) -> BoardPoints | None:
        """Return the points of the board in mono8 ``pixels``, shape (height, width); None without a board.

        Edges of tags are straight without the lens of the picture, as far as it is known.
        """

    def hint(self, pixels: Pixels) -> str:
        """Return what else a picture without the board shows, or an empty text."""


class Chessboard:
    """A chessboard, found by OpenCV.

    Sources: A. Duda, U. Frese, "Accurate detection and localization of checkerboard corners for calibration",
    BMVC 2018, for the search; W. Förstner, E. Gülch, 1987, for the refinement.
    """

    uses_lens = False

    def __init__(self, columns: int, rows: int, square: float) -> None:
        """Create a board.

        ``columns`` and ``rows`` count inner corners, one less than squares; ``square`` is the edge of a
        square [m].

        Raises:
            BoardError: There are fewer than three by three inner corners.
        """
        if min(columns, rows) < 3:
            raise BoardError(f"a chessboard has 3 x 3 inner corners or more, found {columns} x {rows}")
        self._size = columns, rows
        self._points_B = _grid(columns, rows, square).reshape(-1, 3)

    def find(self, pixels: Pixels, lens: Lens | None = None) -> BoardPoints | None:
        """Return the inner corners, all of them or None."""
        for flags in _SEARCHES:
            found, corners = cv2.findChessboardCornersSB(pixels, self._size, flags=flags)
            if found:
                return BoardPoints(self._points_B, self._refined(pixels, np.asarray(corners, np.float32)))
        return None

    def _refined(self, pixels: Pixels, corners: NDArray[np.float32]) -> Array:
        columns, rows = self._size
        grid = corners.reshape(rows, columns, 2)
        steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1)]
        half = max(int(_WINDOW * min(steps)), _LEAST_WINDOW_PX)
        refined = cv2.cornerSubPix(pixels, corners.reshape(-1, 1, 2), (half, half), (-1, -1), _SETTLED)
        return np.asarray(refined, dtype=np.float64).reshape(-1, 2)

    def hint(self, pixels: Pixels) -> str:
        """Return how many AprilTags there are, which a search takes for squares, or inner corners."""
        tags = TagFinder((_USUAL_FAMILY,)).find(pixels)
        if len(tags) > 1:
            return f"{len(tags)} AprilTags and no chessboard"
        found, _, grid = cv2.findChessboardCornersSBWithMeta(
            pixels, (3, 3), cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE
        )
        if not found:
            return ""
        few, many = sorted(grid.shape[:2])
        return f"a chessboard of {many}x{few} inner corners"


class CharucoBoard:
    """A chessboard with ArUco markers in its white squares, of which a part may be seen; found by OpenCV."""

    uses_lens = False

    def __init__(self, columns: int, rows: int, square: float, marker: float, dictionary: str) -> None:
        """Create a board.

        ``columns`` and ``rows`` count squares, of the edge ``square``; ``marker`` is the edge of the black
        square of a marker [m], and ``dictionary`` a name of OpenCV, such as ``DICT_4X4_50``.

        Raises:
            BoardError: There is no such board.
            UnknownNameError: There is no such dictionary.
        """
        known = [name.removeprefix(_DICTIONARY) for name in dir(cv2.aruco) if name.startswith(_DICTIONARY)]
        name = dictionary.removeprefix(_DICTIONARY)
        if name not in known:
            raise UnknownNameError("dictionary", dictionary, known)
        markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, _DICTIONARY + name))
        count, most = columns * rows // 2, len(markers.bytesList)
        if min(columns, rows) < 3 or count > most:
            raise BoardError(
                f"{columns} x {rows} squares hold {count} markers; expected 3 x 3 squares or more and, of "
                f"this dictionary, at most {most} markers"
            )
        if not 0.0 < marker < square:
            raise BoardError(f"a marker is smaller than its square of {square} m, found {marker}")
        self._detectors = []
        # Before version 4.6 OpenCV began boards of an even number of rows with a white square.
        for old in (False, True)[: 1 + (rows % 2 == 0)]:
            board = cv2.aruco.CharucoBoard((columns, rows), square, marker, markers)
            board.setLegacyPattern(old)
            self._detectors.append(cv2.aruco.CharucoDetector(board))
        self._points_B = np.asarray(board.getChessboardCorners(), dtype=np.float64).reshape(-1, 3)

    def find(self, pixels: Pixels, lens: Lens | None = None) -> BoardPoints | None:
        """Return the inner corners that are seen."""
        for detector in self._detectors:
            corners, ids, _, _ = detector.detectBoard(pixels)
            if ids is not None and len(ids) >= _FEWEST_POINTS:
                points_B = self._points_B[np.ravel(ids)]
                if np.linalg.matrix_rank(points_B - points_B[0]) == 2:
                    return BoardPoints(points_B, np.asarray(corners, dtype=np.float64).reshape(-1, 2))
        return None

    def hint(self, pixels: Pixels) -> str:
        """Return which markers are seen."""
        found = self._detectors[0].detectBoard(pixels)[3]
        count = 0 if found is None else len(found)
        return f"{counted(count, 'marker')} of the dictionary" if count else ""


class TagGrid:
    """A grid of AprilTags with ids from 0, row by row from the top or from the bottom.

    Each picture shows by itself which of the two it is, and how the tags are turned in the grid: those that
    OpenCV prints are turned by 180 degrees.
    """

    uses_lens = True

    def __init__(self, columns: int, rows: int, pitch: float, tag_size: float, family: str) -> None:
        """Create a grid.

        ``pitch`` is the distance from a tag to the same edge of the next one, and ``tag_size`` the edge of
        its black square [m].

        Raises:
            BoardError: The tags overlap, or there are fewer than two.
            ParameterError: There is no such family.
        """
        if columns * rows < 2 or not 0.0 < tag_size < pitch:
            raise BoardError(
                f"expected 2 tags or more, each smaller than their distance of {pitch} m, found "
                f"{columns} x {rows} tags of {tag_size} m"
            )
        self._family, self._count = family, columns * rows
        self._finder = TagFinder((family,))
        x, y = tag_size * np.array([[0, 1], [1, 1], [1, 0], [0, 0]]).T  # the order of TagDetection
        square = np.stack([x, y, np.zeros(4)], axis=-1)
        places = _grid(columns, rows, pitch)
        self._layouts = [
            (ordered.reshape(-1, 1, 3) + np.roll(square, turn, axis=0))
            for ordered, turn in itertools.product((places, places[::-1]), range(4))
        ]

    def find(self, pixels: Pixels, lens: Lens | None = None) -> BoardPoints | None:
        """Return the corners of the tags that are seen, each of them once; None if no such grid is."""
        finder = self._finder if lens is None else TagFinder((self._family,), lens)
        found = [f.tag for f in finder.find(pixels)]
        ids = [tag.tag_id for tag in found]
        once = [tag for tag in found if ids.count(tag.tag_id) == 1 and tag.tag_id < self._count]
        if 4 * len(once) < _FEWEST_POINTS:
            return None
        corners = np.concatenate([tag.corners for tag in once])
        which = [tag.tag_id for tag in once]
        possible = [layout[which].reshape(-1, 3) for layout in self._layouts]
        misfits = [_misfit(points_B, corners) for points_B in possible]
        least = int(np.argmin(misfits))
        edges = np.linalg.norm(corners - np.roll(corners.reshape(-1, 4, 2), 1, axis=1).reshape(-1, 2), axis=1)
        if misfits[least] > _MOST_MISFIT * edges.mean():
            return None
        return BoardPoints(possible[least], corners)

    def hint(self, pixels: Pixels) -> str:
        """Return the ids of the tags that are seen."""
        ids = [found.tag.tag_id for found in self._finder.find(pixels)]
        return f"tags {', '.join(map(str, ids))}" if ids else ""


def _grid(columns: int, rows: int, pitch: float) -> NDArray[np.float64]:
    """Return the points of a grid, shape (rows, columns, 3) [m]."""
    x, y = np.meshgrid(pitch * np.arange(columns), pitch * np.arange(rows))
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def _misfit(points_B: Array, corners: Array) -> float:
    """Return by how much the corners are off a perspective picture of the points, RMS [px]."""
    homography, _ = cv2.findHomography(points_B[:, :2], corners)
    if homography is None:
        return float("inf")
    shown = cv2.perspectiveTransform(points_B[np.newaxis, :, :2], homography)[0]
    return float(np.sqrt(((shown - corners) ** 2).mean()))
