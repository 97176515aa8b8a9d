"""What a photograph of tags tells of its camera: blur, motion, noise, and grey levels of ink and paper."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import OptimizeWarning, curve_fit, nnls
from scipy.special import erf

from msrr_perception.mapping.mapper import TaggedPicture
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Cross sections of an edge: number, share left out at either end, and half-length in modules.
SECTIONS, END_SHARE, REACH = 24, 0.15, 0.9


@dataclass
class Light:
    """What was fitted to one photograph: width of edges without motion, motion (2,) [px], grey levels."""

    width: float
    smear: Array
    black: float
    white: float


def edge_width(pixels: Pixels, a: Array, b: Array, inward: Array) -> tuple[float, float, float] | None:
    """Return the width (sigma) of an edge from a to b [px], and the grey levels inside and outside."""
    along, side = b - a, np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
    side = side if side @ inward < 0.0 else -side
    reach = max(REACH * abs(inward @ side) / 8.0, 2.5)
    t = np.linspace(-reach, reach, 31)
    s = np.linspace(END_SHARE, 1.0 - END_SHARE, SECTIONS)
    points = a + s[:, None, None] * along + t[None, :, None] * side
    maps = points.astype(np.float32)
    columns, rows = maps[..., 0], maps[..., 1]
    sections = cv2.remap(pixels, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    grey = sections.mean(axis=0)

    def step(x: Array, middle: float, sigma: float, low: float, high: float) -> Array:
        return low + (high - low) * 0.5 * (1.0 + erf((x - middle) / (math.sqrt(2.0) * sigma)))

    try:
        warnings.simplefilter("error", OptimizeWarning)
        guess = (0.0, 0.8, grey[:5].mean(), grey[-5:].mean())
        (middle, sigma, low, high), _ = curve_fit(step, t, grey, guess, maxfev=200)
    except (RuntimeError, OptimizeWarning):  # no edge to fit
        return None
    good = abs(middle) < 1.5 and 0.2 < abs(sigma) < reach and high - low > 20.0
    return (abs(sigma), low, high) if good else None


def edges_of(pixels: Pixels, corners: Array) -> list[tuple[Array, float, float, float]]:
    """Return normal, width and grey levels of the edges of a tag that can be measured."""
    found = []
    for a, b, c in zip(corners, np.roll(corners, -1, axis=0), np.roll(corners, -2, axis=0), strict=True):
        measured = edge_width(pixels, a, b, c - b)
        if measured is not None:
            normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
            found.append((normal, *measured))
    return found


def fit_light(pixels: Pixels, picture: TaggedPicture) -> Light | None:
    """Fit blur and grey levels of a photograph to the edges of its tags: sigma^2 = s^2 + (m . n)^2 / 12."""
    edges = [edge for tag in picture.tags for edge in edges_of(pixels, tag.corners)]
    if len(edges) < 4:
        return None
    normals, squares = np.array([e[0] for e in edges]), np.array([e[1] for e in edges]) ** 2
    best, found = math.inf, (0.0, np.zeros(2))
    for angle in np.linspace(0.0, math.pi, 36, endpoint=False):
        direction = np.array([math.cos(angle), math.sin(angle)])
        A = np.column_stack([np.ones(len(edges)), (normals @ direction) ** 2 / 12.0])
        (still, motion), error = nnls(A, squares)
        if error < best:
            best, found = error, (math.sqrt(still), math.sqrt(motion) * direction)
    return Light(*found, *(float(np.median([e[i] for e in edges])) for i in (2, 3)))


def fit_noise(photographs: Sequence[Pixels]) -> tuple[float, float]:
    """Return read noise and shot noise at white [grey levels], from blocks without their slope."""
    rows, columns = np.mgrid[:8, :8]
    A = np.column_stack([np.ones(64), rows.ravel(), columns.ravel()])
    remove = np.eye(64) - A @ np.linalg.pinv(A)
    means, variances = [], []
    for pixels in photographs:
        h, w = pixels.shape[0] // 8, pixels.shape[1] // 8
        blocks = (
            pixels[: 8 * h, : 8 * w].reshape(h, 8, w, 8).swapaxes(1, 2).reshape(-1, 64).astype(np.float64)
        )
        means.append(blocks.mean(axis=1))
        variances.append(((blocks @ remove) ** 2).sum(axis=1) / 61.0)
    mean, variance = np.concatenate(means), np.concatenate(variances)
    levels = [
        (low + 10.0, np.median(variance[(mean >= low) & (mean < low + 20)])) for low in range(40, 220, 20)
    ]
    grey, typical = np.array(levels).T
    shot, read = np.polyfit(grey / 255.0, typical, 1)
    return math.sqrt(max(read, 0.0)), math.sqrt(max(shot, 0.0))
