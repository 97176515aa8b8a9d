"""The errors of lens and image sensor: Gaussian blur, shot noise, read noise, whole grey levels.

Light passes in this order: blur and shading of the lens, noise in proportion to what arrives, gain and tone
curve (:mod:`msrr_bullet.sensors.image_response`).

Every pixel is a function of the key of the camera, the number of the frame and the position in the full
frame; so a window read out alone equals the crop of the full frame, noise included. The normal generators of
libraries cannot give that (they use a varying number of random words per sample) and take 3 ms per VGA frame.
Here all cameras share a periodic tile of noise; a hash of the camera's key and the frame's number gives the
position of the frame on the tile, and one of four mirror images of the tile: four million different frames.
"""

from __future__ import annotations

import hashlib
from functools import cache

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.sensors.image_response import ImageResponse
from msrr_bullet.sensors.kernels.readout import TILE, Shading, convert_light
from msrr_scenes.arrays import frozen, read_only
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Pixels

#: Sum of the blur kernel; 255 times the square of this has to stay below 2**24.
_KERNEL_SUM = 256

#: Seed of the tile of noise.
_TILE_SEED = 0

_NO_SHADING = Shading(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


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

        The key has up to 128 bits and is derived from the seed and the name of the camera. Standard
        deviations are those of the lens blur [px], of the read noise, and of the shot noise at white, 255
        [grey levels]; 0 is a perfect lens or sensor. The response shades before the noise, and has its gain
        and tone curve behind it.
        """
        self._key = key.to_bytes(16, "little")
        self._kernel = blur_kernel(blur_px)
        self._radius = len(self._kernel) // 2
        self._variance = noise_grey**2, shot_grey**2 / 255.0
        self._shading = None if response is None else response.shading
        self._per_grey, self._tone = (
            (1.0, np.minimum(np.arange(1 << 16), 255).astype(np.uint8))
            if response is None
            else (response.per_grey, response.tone)
        )

    @property
    def margin(self) -> int:
        """Width of the margin around a window that the blur needs [px]."""
        return self._radius

    def read_out(self, ideal: Pixels, window: Window, frame: int) -> Pixels:
        """Return the pixels of ``window`` of frame number ``frame`` with blur and noise.

        ``ideal`` are the noise-free pixels of ``window.padded(self.margin)``.

        Raises:
            ValueError: The shape of ``ideal`` is not that of the padded window.
        """
        r = self._radius
        if ideal.shape != (window.height + 2 * r, window.width + 2 * r):
            raise ValueError(f"{ideal.shape} pixels given for {window} with a margin of {r}")
        digest = hashlib.blake2b(frame.to_bytes(8, "little"), key=self._key, digest_size=9).digest()
        out = np.empty((window.height, window.width), dtype=np.uint8)
        convert_light(
            read_only(np.ascontiguousarray(ideal)),  # as kept pictures are: one kind of array is compiled for
            self._kernel,
            window.x,
            window.y,
            self._shading is not None,
            self._shading or _NO_SHADING,
            _noise_tiles()[digest[8] >> 1 & 1],
            (int.from_bytes(digest[:4], "little") + window.x) % TILE,
            (int.from_bytes(digest[4:8], "little") + window.y) % TILE,
            digest[8] & 1 != 0,
            *self._variance,
            self._per_grey,
            self._tone,
            out,
        )
        return out


def blur_kernel(sigma: float) -> NDArray[np.float32]:
    """Return the kernel of a blur of ``sigma`` [px], shape (2 r + 1,), whole numbers that sum to 256.

    It is the discrete Gaussian (Lindeberg, Scale-space for discrete signals, PAMI 1990), whose variance is
    sigma**2 at any sigma; a sampled Gaussian of 0.4 px blurs by only 0.28 px. Rounding cuts the tails: a blur
    of 1.6 px is 0.6 % too small, of 5 px 1.5 %, of 20 px 7 %, and one of up to 0.06 px is none.
    """
    angle = 2.0 * np.pi * np.arange(129) / 256.0
    half = np.rint(_KERNEL_SUM * np.fft.irfft(np.exp(sigma**2 * (np.cos(angle) - 1.0)))[:128])
    radius = int(np.flatnonzero(half)[-1])
    half[0] = _KERNEL_SUM - 2.0 * half[1 : radius + 1].sum()
    return np.concatenate([half[radius:0:-1], half[: radius + 1]]).astype(np.float32)


@cache
def _noise_tiles() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return standard normal numbers, shape (TILE, TILE), and the same with their columns in reverse order.

    They are the same for all cameras and trials. To go through a row from its end would take longer.
    """
    tile = np.random.Generator(np.random.PCG64(_TILE_SEED)).standard_normal((TILE, TILE), dtype=np.float32)
    return frozen(tile), frozen(np.ascontiguousarray(tile[:, ::-1]))
