"""The tags of many pictures with their poses, and their corners' noise as the pictures show it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv

from msrr_perception.photographs.picture_files import PictureError
from msrr_perception.photographs.tag_finder import FoundTag, TagFinder
from msrr_perception.photographs.tag_poses import CORNER_SIGMA_PX, TagPose, tag_poses
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.messages import Pixels
from msrr_scenes.specs.sensors import CalibrationSpec

#: Numbers that a pose leaves free of the eight coordinates of a tag's corners.
_FREE = 2

#: Largest edge of a tag [m], that of scenes. A larger number is one of millimetres.
_LARGEST_M = 10.0


@dataclass(frozen=True, eq=False)
class PictureTags:
    """The tags of a picture.

    Attributes:
        name: Name of the picture.
        width: Its width [px].
        height: Its height [px].
        tags: Each tag with its one or two poses, the best first; no poses if the camera or the size of the
            tags is not known.
    """

    name: str
    width: int
    height: int
    tags: tuple[tuple[FoundTag, tuple[TagPose, ...]], ...]


class PictureReader:
    """Reader of the tags of pictures that one camera took, all of one size."""

    def __init__(
        self,
        families: Sequence[str],
        calibration: CalibrationSpec | None = None,
        tag_size: float | None = None,
    ) -> None:
        """Create a reader.

        Args:
            families: Families of the tags.
            calibration: Calibration of the camera; None if it is not known.
            tag_size: Edge of the black square of all tags [m]; None if it is not known.

        Raises:
            SceneError: There is a size without a calibration, or it is that of no tag.
            UnknownNameError: There is no such family.
        """
        if tag_size is not None and calibration is None:
            raise SceneError("the size of a tag gives poses only with the calibration of the camera")
        if tag_size is not None and not 0.0 < tag_size <= _LARGEST_M:
            bounds = f"more than 0 m and {_LARGEST_M:g} m at most"
            raise SceneError(f"the edge of a tag is {bounds}, found {tag_size:g}")
        self.tag_size = tag_size
        self._calibration = calibration
        self._finder = TagFinder(families)
        self.families = self._finder.families
        self._by_size: dict[tuple[int, int], tuple[Lens, TagFinder]] = {}

    def lens(self, width: int, height: int) -> Lens | None:
        """Return the lens of pictures of a size [px]; None without a calibration."""
        return None if self._calibration is None else self._with_lens("", width, height)[0]

    def read(self, name: str, pixels: Pixels) -> PictureTags:
        """Return the tags of a picture, mono8 of shape (height, width).

        Raises:
            PictureError: The calibration belongs to pictures of another size.
        """
        height, width = pixels.shape
        if self._calibration is None:
            found = self._finder.find(pixels)
            return PictureTags(name, width, height, tuple((tag, ()) for tag in found))
        lens, finder = self._with_lens(name, width, height)
        rows = []
        for found_tag in finder.find(pixels):
            sigma = found_tag.tag.corner_sigma_px
            sure = CORNER_SIGMA_PX if sigma is None else np.maximum(sigma, CORNER_SIGMA_PX)
            corners = found_tag.tag.corners
            poses = () if self.tag_size is None else tag_poses(lens, corners, self.tag_size, sure)
            rows.append((found_tag, poses))
        return PictureTags(name, width, height, tuple(rows))

    def _with_lens(self, name: str, width: int, height: int) -> tuple[Lens, TagFinder]:
        assert self._calibration is not None
        told = self._calibration
        if (width, height) != (told.width_px or width, told.height_px or height):
            size = f"{told.width_px} x {told.height_px} px"
            raise PictureError(f"{name}: {width} x {height} px, and the calibration is of pictures of {size}")
        key = width, height
        if key not in self._by_size:
            own = told.lens(width, height)
            self._by_size[key] = own, TagFinder(self.families, own)
        return self._by_size[key]


def corner_sigma_px(pictures: Sequence[PictureTags]) -> float:
    """Return the standard deviation of the corners, as the residuals of all best poses together show it [px].

    A calibration that is wrong and tags that are not flat count as well; a few tags that were read wrongly do
    not. It is never less than what the corners of photographs were measured to have,
    :data:`CORNER_SIGMA_PX`.
    """
    squares = [8.0 * pose.reprojection_px**2 for pose in _best(pictures)]
    return max(CORNER_SIGMA_PX, math.sqrt(_typical(squares)))


def covariance_factor(pictures: Sequence[PictureTags]) -> float:
    """Return by how much the covariances of the poses are too small, as all best poses together show it.

    It is 1 where the residuals are no larger than the standard deviations of the corners let expect.
    """
    return max(1.0, _typical([pose.misfit for pose in _best(pictures)]))


def _best(pictures: Sequence[PictureTags]) -> list[TagPose]:
    return [poses[0] for picture in pictures for _, poses in picture.tags if poses]


def _typical(squares: Sequence[float]) -> float:
    """Return the variance of residuals by the median of the sums of their squares; 0 of none."""
    median = 2.0 * float(gammaincinv(0.5 * _FREE, 0.5))  # of the chi-squared distribution
    return float(np.median(squares) / median) if squares else 0.0
