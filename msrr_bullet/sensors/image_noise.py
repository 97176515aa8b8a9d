"""The errors of lens and image sensor: Gaussian blur, shot noise, read noise, whole grey levels.

Light passes in this order: blur and shading of the lens, noise in proportion to what arrives, gain and tone
curve (:mod:`msrr_bullet.sensors.image_response`).

Every pixel is a function of the key of the camera, the number of the frame and the position in the full
frame; so a window read out alone equals the crop of the full frame, noise included. The normal generators of
libraries cannot give that (they use a varying number of random words per sample) and take 3 ms per VGA frame.
Here a tile of noise is drawn once per camera; a hash of the frame number gives the position of the frame on
the periodic tile and one of eight mirror images of the tile.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_bullet.sensors.image_response import ImageResponse
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Pixels

#: Edge of the noise tile [px].
_TILE = 1024

#: Sum of the blur kernel; 255 times the square of this has to stay below 2**24.
_KERNEL_SUM = 256


class ImageNoise:
    """Lens blur, shot noise and read noise of one camera.

    Read noise is Gaussian and independent of the light. Shot noise of many photons is Gaussian too, with a
    variance in proportion to the light.
    """

    def __init__(
        self,
        key: int,
        blur_px: float,
        noise_grey: float,
        shot_grey: float = 0.0,
        response: ImageResponse | None = None,
    ) -> None:
        """Set up the noise of a camera.

        Args:
            key: Number of up to 128 bits, derived from the seed and the name of the camera.
            blur_px: Standard deviation of the lens blur [px]; 0 is a perfect lens.
            noise_grey: Standard deviation of the read noise [grey levels]; 0 is a perfect sensor.
            shot_grey: Standard deviation of the shot noise at white, 255 [grey levels].
            response: Shading before the noise, and gain and tone curve behind it; None if there is none.
        """
        self._key = key.to_bytes(16, "little")
        self._kernel = blur_kernel(blur_px)
        self._radius = len(self._kernel) // 2
        self._tile: NDArray[np.int16] | NDArray[np.float32] | None = None
        self._sigma: NDArray[np.float32] | None = None
        self._variance = np.float32(noise_grey**2), np.float32(shot_grey**2 / 255.0)
        self._response = response
        if response is not None:
            self._tile = _unit_tile(key) if noise_grey > 0.0 or shot_grey > 0.0 else None
        elif shot_grey > 0.0:
            light = np.arange(256) / 255.0
            self._sigma = np.sqrt(noise_grey**2 + shot_grey**2 * light).astype(np.float32)
            self._tile = _unit_tile(key)
        elif noise_grey > 0.0:
            self._tile = _noise_tile(key, noise_grey)

    @property
    def margin(self) -> int:
        """Width of the margin around a window that the blur needs [px]."""
        return self._radius

    def read_out(self, ideal: Pixels, window: Window, frame: int) -> Pixels:
        """Return the pixels of ``window`` of frame number ``frame`` with blur and noise.

        Args:
            ideal: Noise-free pixels of ``window.padded(self.margin)``.
            window: The window in the full frame.
            frame: Number of the frame.

        Raises:
            ValueError: The shape of ``ideal`` is not that of the padded window.
        """
        r = self._radius
        if ideal.shape != (window.height + 2 * r, window.width + 2 * r):
            raise ValueError(f"{ideal.shape} pixels given for {window} with a margin of {r}")
        if self._response is not None:
            light = self._response.shaded(self._blurred(ideal), window)
            return self._response.converted(self._with_noise(light, window, frame))
        pixels = np.rint(self._blurred(ideal)).astype(np.uint8) if r else ideal
        if self._tile is None:
            return np.ascontiguousarray(pixels)
        out = np.empty(pixels.shape, dtype=np.uint8)
        for part, noise in self._noise(self._tile, window, frame):
            if self._sigma is not None:  # the tile holds standard normal numbers
                noise = np.rint(noise * self._sigma[pixels[part]])
            out[part] = np.clip(pixels[part] + noise, 0, 255)
        return out

    def _blurred(self, ideal: Pixels) -> NDArray[np.float32]:
        """Return the light of the pixels within the margin, exactly: its sums are whole numbers below 2**24.

        So rounding does not depend on how OpenCV divides the image.
        """
        r = self._radius
        if not r:
            return ideal.astype(np.float32)
        sums = cv2.sepFilter2D(ideal, cv2.CV_32F, self._kernel, self._kernel)[r:-r, r:-r]
        return sums * np.float32(1.0 / _KERNEL_SUM**2)

    def _with_noise(self, light: NDArray[np.float32], window: Window, frame: int) -> NDArray[np.float32]:
        if self._tile is None:
            return light
        read, shot = self._variance
        out = np.empty_like(light)
        for part, noise in self._noise(self._tile, window, frame):
            sigma = np.sqrt(read + shot * light[part]) if shot > 0.0 else np.sqrt(read)
            np.multiply(noise, sigma, out=out[part])
            out[part] += light[part]
        return out

    def _noise(
        self, tile: NDArray[np.int16] | NDArray[np.float32], window: Window, frame: int
    ) -> Iterator[tuple[tuple[slice, slice], NDArray[np.int16] | NDArray[np.float32]]]:
        """Yield the parts of a window, as slices of rows and columns, with their noise from the tile."""
        digest = hashlib.blake2b(frame.to_bytes(8, "little"), key=self._key, digest_size=9).digest()
        x = (int.from_bytes(digest[:4], "little") + window.x) % _TILE
        y = (int.from_bytes(digest[4:8], "little") + window.y) % _TILE
        variant = digest[8]
        if variant & 1:
            tile = tile.T
        tile = tile[:: -1 if variant & 2 else 1, :: -1 if variant & 4 else 1]
        for out_y, tile_y, height in _runs(y, window.height):
            for out_x, tile_x, width in _runs(x, window.width):
                part = slice(out_y, out_y + height), slice(out_x, out_x + width)
                yield part, tile[tile_y : tile_y + height, tile_x : tile_x + width]


def _runs(start: int, length: int) -> list[tuple[int, int, int]]:
    """Split ``length`` pixels from ``start`` on the periodic tile: (offset, position on the tile, length)."""
    runs, offset = [], 0
    while offset < length:
        position = (start + offset) % _TILE
        step = min(length - offset, _TILE - position)
        runs.append((offset, position, step))
        offset += step
    return runs


def blur_kernel(sigma: float) -> NDArray[np.float32]:
    """Return the one-dimensional blur kernel, shape (2 r + 1,), whole numbers that sum to 256.

    It is the discrete Gaussian (Lindeberg, Scale-space for discrete signals, PAMI 1990), whose variance is
    sigma**2 at any sigma; a sampled Gaussian of 0.4 px blurs by only 0.28 px.

    Args:
        sigma: Standard deviation [px].
    """
    angle = 2.0 * np.pi * np.arange(129) / 256.0
    half = np.rint(_KERNEL_SUM * np.fft.irfft(np.exp(sigma**2 * (np.cos(angle) - 1.0)))[:128])
    radius = int(np.flatnonzero(half)[-1])
    half[0] = _KERNEL_SUM - 2.0 * half[1 : radius + 1].sum()
    return np.concatenate([half[radius:0:-1], half[: radius + 1]]).astype(np.float32)


def _unit_tile(key: int) -> NDArray[np.float32]:
    """Return standard normal numbers, shape (1024, 1024)."""
    rng = np.random.Generator(np.random.PCG64(key))
    return rng.standard_normal((_TILE, _TILE), dtype=np.float32)


def _noise_tile(key: int, sigma: float) -> NDArray[np.int16]:
    """Return Gaussian noise in whole grey levels, shape (1024, 1024).

    The pixels that it is added to are whole, so that rounding the tile once equals rounding every pixel.
    """
    noise = sigma * _unit_tile(key)
    rounded: NDArray[np.int16] = np.rint(np.clip(noise, -255.0, 255.0)).astype(np.int16)
    return rounded
