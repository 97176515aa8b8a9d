"""The camera that shows boards as they were seen: intrinsics, distortion, and how sure they are.

OpenCV fits (``calibrateCameraExtended``, after Z. Zhang, "A flexible new technique for camera calibration",
PAMI 22, 2000). What is added here: how many coefficients of the distortion are free, standard deviations
that hold on real pictures, and which pictures contradict the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from msrr_perception.camera_calibration.boards import BoardPoints
from msrr_perception.camera_calibration.result import ENTRIES, CameraCalibration, FittedView, LensModel
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.distortion import COEFFICIENTS, has_inverse
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.sensors import CalibrationSpec

#: Numbers of coefficients that may be free: none, k1, k2, p1 and p2, k3.
MODELS = (0, 1, 2, 4, 5)

#: Fewest pictures: two determine a camera, and a third one shows whether they contradict each other.
FEWEST_PICTURES = 3

#: Largest number of groups into which pictures are dealt to be held out in turn.
_MOST_GROUPS = 10

#: RMS distance of the corners of two pictures up to which they show the board in one place [px]. Such
#: pictures are held out together, for each of them is no test of a camera that was fitted to the other one.
_SAME_PLACE_PX = 3.0

#: A picture contradicts the others if its residual is more than this many times the median, and more than
#: this many pixels: beside very sharp pictures the corners of a distant board have three times the residual.
_BAD, _LEAST_BAD_PX = 3.0, 0.3

#: Angle within which boards count as parallel [deg]. Parallel boards do not tell the focal length (Zhang,
#: section 3.4); near to that it is known by the noise alone, which feigns angles of some degrees.
_PARALLEL_DEG = 8.0

#: Number of coefficients that are free while bad pictures are looked for.
_FIRST_MODEL = 2

#: Flags of OpenCV that hold what is not free, by the number of free coefficients.
_HELD: Mapping[int, int] = {
    0: cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3,
    1: cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3,
    2: cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3,
    4: cv2.CALIB_FIX_K3,
    5: 0,
}


class CalibrationError(MsrrError):
    """Pictures that do not determine a camera."""


@dataclass(frozen=True, eq=False)
class BoardView:
    """Points of a board that were found in a picture, with the name of the picture."""

    name: str
    points: BoardPoints


@dataclass(frozen=True, eq=False)
class _Fit:
    """What OpenCV returns, and the residual of each picture [px]."""

    K: Array
    lens: Array
    sigma: Array
    residuals_px: Array

    @property
    def entries(self) -> Array:
        return np.array([self.K[0, 0], self.K[1, 1], self.K[0, 2], self.K[1, 2], *self.lens])


@dataclass(frozen=True, eq=False)
class _Trial:
    """A lens model: the fit to all pictures, those to parts of them, and the errors where it was not fitted.

    Attributes:
        fit: Fit to all pictures.
        partial: Fits without one group of pictures each.
        errors: Mean squared residual of each picture by the fit without its group [px^2].
        wrong: Why nobody can use the lens; empty if it can be used.
    """

    fit: _Fit
    partial: list[_Fit]
    errors: Array
    wrong: str

    @classmethod
    def of(cls, views: Sequence[BoardView], size: tuple[int, int], free: int) -> _Trial:
        group = _places(views) % _MOST_GROUPS
        errors, partial = np.zeros(len(views)), []
        for number in np.unique(group):
            partial.append(_fit([v for v, g in zip(views, group, strict=True) if g != number], size, free))
            for i in np.flatnonzero(group == number):
                fitted = _fitted(views[int(i)], partial[-1].K, partial[-1].lens, used=False)
                errors[i] = fitted.rms_px**2
        fit = _fit(views, size, free)
        return cls(fit, partial, errors, _why_unusable(fit, size))


def calibrate_camera(
    views: Sequence[BoardView], width: int, height: int, free: int | None = None
) -> CameraCalibration:
    """Return the camera that shows some boards.

    The number of coefficients of the distortion that are free is the smallest one with which pictures that
    were held out are shown as well as with any other one, within one standard error. Pictures that contradict
    the others are left out. ``free`` is one of :data:`MODELS`, or None to have it chosen. The width and the
    height are those of all pictures [px].

    Raises:
        CalibrationError: The pictures do not determine a camera.
    """
    if free is not None and free not in MODELS:
        raise CalibrationError(f"{free} free coefficients; expected one of {', '.join(map(str, MODELS))}")
    if len(views) < FEWEST_PICTURES:
        raise CalibrationError(
            f"{len(views)} picture(s) with a board; {FEWEST_PICTURES} are the fewest, and 10 to 20 are "
            "better, with the board tilted to all sides and near all borders of the picture"
        )
    size = width, height
    used = _consistent(views, size, _FIRST_MODEL if free is None else free)
    kept = [views[i] for i in used]
    places = len(set(_places(kept).tolist()))
    if places < FEWEST_PICTURES:
        raise CalibrationError(
            f"{len(kept)} pictures show the board in {places} place(s); {FEWEST_PICTURES} are the fewest, "
            "and 10 to 20 are better: move the camera or the board between pictures"
        )
    tried = {n: _Trial.of(kept, size, n) for n in (MODELS if free is None else (free,))}
    usable = {n: trial.errors for n, trial in tried.items() if not trial.wrong}
    if not usable:
        why = next(iter(tried.values())).wrong
        raise CalibrationError(
            f"the pictures do not determine the lens: {why}; show the board near all borders"
        )
    credible = _as_good_as_the_best(usable)
    chosen = min(credible)
    # Where a lens that nobody can use shows held-out boards better, the chosen one has errors that no other
    # usable one tells of.
    of_all = _as_good_as_the_best({n: trial.errors for n, trial in tried.items()})
    refused = [] if chosen in of_all else [n for n in of_all if tried[n].wrong]
    fit, spread = tried[chosen].fit, np.array([f.entries for f in tried[chosen].partial])
    fitted = tuple(_fitted(view, fit.K, fit.lens, i in used) for i, view in enumerate(views))
    _refuse_parallel([view for view in fitted if view.used])
    models = {n: LensModel(n, float(np.sqrt(t.errors.mean())), bool(t.wrong)) for n, t in tried.items()}
    jackknife = np.sqrt((len(spread) - 1) * spread.var(axis=0))
    # What the chosen model leaves out shifts the rest: the principal point, where p1 and p2 are left out.
    shift = np.abs([tried[n].fit.entries - fit.entries for n in (*credible, *refused)]).max(axis=0)
    sigma = np.hypot(np.maximum(jackknife, fit.sigma), np.where(fit.sigma > 0.0, shift, 0.0))
    return CameraCalibration(
        told=_specification(fit, size),
        sigma=dict(zip(ENTRIES, sigma.tolist(), strict=True)),
        noise_sigma=dict(zip(ENTRIES, fit.sigma.tolist(), strict=True)),
        model=models[chosen],
        models=tuple(models.values()) if free is None else (),
        refused=models[min(refused)] if refused else None,
        views=fitted,
    )


def board_residuals(view: BoardView, told: CalibrationSpec) -> Array:
    """Return by how much a camera shows a board elsewhere at the best pose for it, shape (N, 2) [px]."""
    K = np.array([[told.fx_px, 0.0, told.cx_px], [0.0, told.fy_px, told.cy_px], [0.0, 0.0, 1.0]])
    return _fitted(view, K, np.array([getattr(told, name) for name in COEFFICIENTS]), used=False).residuals


def _fit(views: Sequence[BoardView], size: tuple[int, int], free: int) -> _Fit:
    points = [view.points.points_B.astype(np.float32) for view in views]
    corners = [view.points.corners.astype(np.float32) for view in views]
    try:
        _, K, lens, _, _, sigma, _, residuals = cv2.calibrateCameraExtended(
            points, corners, size, np.eye(3), np.zeros(len(COEFFICIENTS)), flags=_HELD[free]
        )
    except cv2.error:
        raise CalibrationError("no camera shows the boards like this; are there different views?") from None
    return _Fit(
        K=np.asarray(K, dtype=np.float64),
        lens=np.asarray(lens, dtype=np.float64).ravel()[: len(COEFFICIENTS)],
        sigma=np.asarray(sigma, dtype=np.float64).ravel()[: len(ENTRIES)],
        residuals_px=np.asarray(residuals, dtype=np.float64).ravel(),
    )


def _places(views: Sequence[BoardView]) -> NDArray[np.int64]:
    """Return the number of the place of each board, shape (N,): it is seen where the first one there was.

    The first one, not any: a board that moves slowly is near to where it was a picture ago, all the way.
    """
    firsts: list[dict[bytes, Array]] = []
    places: list[int] = []
    for view in views:
        seen = {p.tobytes(): c for p, c in zip(view.points.points_B, view.points.corners, strict=True)}
        place = next((k for k, first in enumerate(firsts) if _in_one_place(seen, first)), len(firsts))
        if place == len(firsts):
            firsts.append(seen)
        places.append(place)
    return np.array(places, dtype=np.int64)


def _in_one_place(seen: Mapping[bytes, Array], first: Mapping[bytes, Array]) -> bool:
    """Return whether corners by their points are those of a board in one place; some may be missing."""
    apart = np.array([seen[point] - first[point] for point in seen.keys() & first.keys()])
    if 2 * len(apart) < min(len(seen), len(first)):
        return False
    return float(np.mean(apart**2)) < 0.5 * _SAME_PLACE_PX**2


def _consistent(views: Sequence[BoardView], size: tuple[int, int], free: int) -> list[int]:
    """Return the indices of the pictures that agree with each other: the worst is left out, one by one."""
    used = list(range(len(views)))
    while True:
        residuals = _fit([views[i] for i in used], size, free).residuals_px
        worst = int(residuals.argmax())
        most = max(_BAD * float(np.median(residuals)), _LEAST_BAD_PX)
        if len(used) == FEWEST_PICTURES or residuals[worst] <= most:
            return used
        del used[worst]


def _as_good_as_the_best(errors: Mapping[int, Array]) -> list[int]:
    """Return the numbers of coefficients that are as good as the best, within its standard error.

    The smallest of them is chosen, which matters: models with more coefficients gain a little where the
    boards were, and lose much where they were not.

    Source: L. Breiman et al., Classification and Regression Trees, 1984, section 3.4.3.
    """
    best = min(errors.values(), key=lambda squares: float(squares.mean()))
    limit = best.mean() + best.std(ddof=1) / np.sqrt(len(best))
    return [n for n, squares in errors.items() if squares.mean() <= limit]


def _refuse_parallel(views: Sequence[FittedView]) -> None:
    normals = np.array([view.X_CB.R[:, 2] for view in views])
    spread = np.degrees(np.arccos(np.clip(np.abs(normals @ normals.T).min(), 0.0, 1.0)))
    if spread < _PARALLEL_DEG:
        raise CalibrationError(
            f"the boards are parallel, within {spread:.0f} degrees; tilt them by 30 to all sides"
        )


def _why_unusable(fit: _Fit, size: tuple[int, int]) -> str:
    """Return why nobody can use a lens: it has no inverse somewhere in the picture, or is none at all."""
    try:
        lens = _specification(fit, size).lens(*size)
    except CalibrationError as error:
        return str(error)
    return "" if has_inverse(lens.camera, lens.distortion) else "two points appear at one pixel"


def _specification(fit: _Fit, size: tuple[int, int]) -> CalibrationSpec:
    try:
        values = dict(zip(ENTRIES, fit.entries.tolist(), strict=True))
        return CalibrationSpec(**values, width_px=size[0], height_px=size[1])
    except ValidationError as error:
        wrong = error.errors(include_url=False)[0]
        text = f"{'.'.join(map(str, wrong['loc']))} = {wrong['input']!s:.20}: {wrong['msg'].lower()}"
        raise CalibrationError(f"they lead to a camera that cannot be: {text}") from None


def _fitted(view: BoardView, K: Array, lens: Array, used: bool) -> FittedView:
    """Return a board at the pose at which a camera shows it best."""
    points_B, corners = view.points.points_B, view.points.corners
    _, rotation, translation = cv2.solvePnP(points_B, corners, K, lens)
    rotation, translation = cv2.solvePnPRefineLM(points_B, corners, K, lens, rotation, translation)
    shown = cv2.projectPoints(points_B, rotation, translation, K, lens)[0].reshape(-1, 2)
    R_CB = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
    X_CB = SE3(R_CB, np.asarray(translation, dtype=np.float64).ravel())
    return FittedView(view.name, corners, np.asarray(shown - corners), X_CB, used)
