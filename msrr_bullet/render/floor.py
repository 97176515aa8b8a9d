"""The background of a picture: a textured floor to the horizon and a plain wall above it, without a mesh.

A floor is a plane, so its image is one homography of its texture. Seen at a grazing angle a pixel covers many
texels; the texture is therefore a pyramid, each pixel blends the two levels next to its footprint, and each
level is warped only over the rows where it counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3

Image = NDArray[np.float32]

_WARP = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP


@dataclass(frozen=True, eq=False)
class Floor:
    """The plane z = 0 of the world with a periodic texture, and the wall above its horizon.

    Attributes:
        paint: Returns the texture, a square whose edge is a power of two [grey levels]; rows run along world
            y and columns along world x.
        period: Edge of the square that the texture covers before it repeats [m].
        wall: Grey level above the horizon.
    """

    paint: Callable[[], Image]
    period: float
    wall: float

    @cached_property
    def levels(self) -> tuple[Image, ...]:
        """Texture pyramid, finest first, each level half the size of the one before [grey levels].

        It is made when the floor is first drawn: a check of a scene draws none.
        """
        return _pyramid(self.paint())

    def image(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Image:
        """Return the background of ``window``, shape (height, width) [grey levels].

        A camera below the floor sees the wall only.
        """
        out = np.full((window.height, window.width), self.wall, dtype=np.float32)
        if X_WC.p[2] <= 0.0:
            return out
        # Homogeneous point of the floor [m] that a pixel shows; the third row is minus the ray's descent t.
        r, p = X_WC.R, X_WC.p
        G = np.stack([p[0] * r[2] - p[2] * r[0], p[1] * r[2] - p[2] * r[1], r[2]])
        G = G @ np.linalg.inv(camera.matrix())
        a, b, c = -G[2]
        gradient = float(np.hypot(a, b))
        x = (np.arange(window.x, window.x_end) * a).astype(np.float32)
        y = (np.arange(window.y, window.y_end) * b + c).astype(np.float32)
        reach = 0.5 * gradient  # half a pixel across the horizon
        rows = np.flatnonzero(y + max(x[0], x[-1]) > -reach)
        if not rows.size:
            return out
        top, bottom = int(rows[0]), int(rows[-1]) + 1
        t = np.add.outer(y[top:bottom], x)
        floor = self._floor(camera, X_WC, G, Window(window.x, window.y + top, window.width, bottom - top), t)
        if t.min() >= reach:
            out[top:bottom] = floor
        else:
            share = np.clip(t / (2.0 * reach) + 0.5, 0.0, 1.0).astype(np.float32)
            out[top:bottom] += share * (floor - np.float32(self.wall))
        return out

    def _floor(self, camera: PinholeCamera, X_WC: SE3, G: Array, window: Window, t: Image) -> Image:
        """Return the floor in ``window``; ``t`` is the descent of its rays, shape (height, width)."""
        # Footprint of a pixel [texels]: h / (f t) across the view, and 1 + k / t times that along it.
        texels = self.levels[0].shape[0] / self.period
        scale = texels * float(X_WC.p[2]) / camera.focal
        k = float(np.hypot(X_WC.R[2, 0], X_WC.R[2, 1]))
        descent = np.maximum(t, np.float32(1e-4))
        last = len(self.levels) - 1
        level = cv2.log((descent + np.float32(k)) / (descent * descent)) * np.float32(1.0 / np.log(2.0))
        level += np.float32(np.log2(scale))
        np.clip(level, np.float32(0.0), np.float32(last), out=level)
        low, high = level.min(axis=1), level.max(axis=1)
        out = np.zeros(t.shape, dtype=np.float32)
        for i in range(int(low.min()), int(np.ceil(high.max())) + 1):
            rows = np.flatnonzero((low < i + 1) & (high > i - 1))
            if not rows.size:
                continue
            first, end = int(rows[0]), int(rows[-1]) + 1
            weight = np.abs(level[first:end] - np.float32(i))
            np.subtract(np.float32(1.0), weight, out=weight)
            np.maximum(weight, np.float32(0.0), out=weight)
            if i == last:  # a single texel: nothing to warp
                weight *= self.levels[i][0, 0]
                out[first:end] += weight
                continue
            n = self.levels[i].shape[0]
            texel = np.array([[n / self.period, 0.0, -0.5], [0.0, n / self.period, -0.5], [0.0, 0.0, 1.0]])
            shift = np.array([[1.0, 0.0, window.x], [0.0, 1.0, window.y + first], [0.0, 0.0, 1.0]])
            warped = cv2.warpPerspective(
                self.levels[i],
                texel @ G @ shift,
                (window.width, end - first),
                flags=_WARP,
                borderMode=cv2.BORDER_WRAP,
            )
            weight *= warped
            out[first:end] += weight
        return out


def _pyramid(texture: Image) -> tuple[Image, ...]:
    """Return a square texture, whose edge is a power of two, and its box-filtered halves to one texel."""
    levels = [texture.astype(np.float32)]
    while levels[-1].shape[0] > 1:
        a = levels[-1]
        levels.append((a[0::2, 0::2] + a[1::2, 0::2] + a[0::2, 1::2] + a[1::2, 1::2]) * np.float32(0.25))
    return tuple(levels)


@cache
def concrete_floor() -> Floor:
    """Return a mottled grey floor with faint joints every half metre, the same in every trial."""
    return Floor(_concrete, period=2.0, wall=160.0)


def _concrete() -> Image:
    """Return the texture of :func:`concrete_floor`, shape (1024, 1024) [grey levels]."""
    texels, mean, contrast = 1024, 105.0, 4.0  # contrast: standard deviation of the mottling
    rng = np.random.Generator(np.random.PCG64(0xF100))
    spectrum = np.fft.rfft2(rng.standard_normal((texels, texels)))
    # As on natural surfaces the amplitude falls with the frequency, from patches of decimetres to grains.
    spectrum /= (np.hypot.outer(np.fft.fftfreq(texels), np.fft.rfftfreq(texels)) + 8.0 / texels) ** 1.2
    spectrum[0, 0] = 0.0
    texture: Array = np.fft.irfft2(spectrum, s=(texels, texels))
    texture *= contrast / texture.std()
    texture += mean
    joint = np.arange(texels) % (texels // 4) < 2
    texture[joint, :] -= 2.0 * contrast
    texture[:, joint] -= 2.0 * contrast
    return texture.astype(np.float32)
