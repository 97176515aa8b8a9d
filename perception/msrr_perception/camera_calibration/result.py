"""What a calibration has found: the camera, how sure it is, and what is left of each picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import COEFFICIENTS
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.sensors import CalibrationSpec

#: Names of what is calibrated, in the order of OpenCV.
ENTRIES = ("fx_px", "fy_px", "cx_px", "cy_px", *COEFFICIENTS)


@dataclass(frozen=True, eq=False)
class FittedView:
    """A board in a picture against the calibration.

    Attributes:
        name: Name of the picture.
        corners: Where its points were found, shape (N, 2) [px].
        residuals: Where the calibration shows them minus where they were found, shape (N, 2) [px].
        X_CB: Pose of the board in the camera.
        used: Whether the calibration is made of it.
    """

    name: str
    corners: Array
    residuals: Array
    X_CB: SE3
    used: bool

    @property
    def rms_px(self) -> float:
        """Root mean square of the distances of its points [px]."""
        return float(np.sqrt((self.residuals**2).sum(axis=1).mean()))


@dataclass(frozen=True)
class LensModel:
    """A choice of free coefficients, and how well it shows boards of which it has seen nothing.

    Attributes:
        free: Number of free coefficients, in the order of OpenCV.
        held_out_px: Root mean square residual of pictures that were held out in turn [px].
        folds: Whether the lens has no inverse somewhere in the picture or is none, so that nobody can use it.
    """

    free: int
    held_out_px: float
    folds: bool


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """The calibration of a camera.

    Attributes:
        told: The calibration as scenes take it.
        sigma: Standard deviation of each of :data:`ENTRIES`; 0 for coefficients that are not free. It is that
            of the jackknife over pictures, or that of independent noise where this is larger, together with
            the largest difference to a model that shows pictures that were held out as well as the best one,
            or better but folds.
        noise_sigma: The same as OpenCV states it, as if the residuals of all points were independent.
        model: The model of the lens.
        models: All models that were tried; empty if the number of coefficients was given.
        views: The boards, in the order of the pictures.
        refused: A model that shows pictures that were held out better than the chosen one by more than chance
            explains, but folds; None without one.
    """

    told: CalibrationSpec
    sigma: Mapping[str, float]
    noise_sigma: Mapping[str, float]
    model: LensModel
    models: tuple[LensModel, ...]
    views: tuple[FittedView, ...]
    refused: LensModel | None = None

    @property
    def rms_px(self) -> float:
        """Root mean square of the distances of all points that were used, as OpenCV has it [px]."""
        squares = np.concatenate([(v.residuals**2).sum(axis=1) for v in self.views if v.used])
        return float(np.sqrt(squares.mean()))
