"""Quantiles of values of which some may be infinite: times to something that never came."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import ConfigDict

from msrr_bullet.statistics import Quantiles


class OpenQuantiles(Quantiles):
    """Quantiles that may be infinite; JSON has no number for that and gets the string ``Infinity``."""

    model_config = ConfigDict(frozen=True, ser_json_inf_nan="strings")

    @classmethod
    def of(cls, values: Sequence[float]) -> OpenQuantiles:
        """Return median, 95th percentile and largest; all None without values."""
        if not values:
            return cls(p50=None, p95=None, max=None)
        return cls(p50=quantile(values, 0.5), p95=quantile(values, 0.95), max=max(values))


def quantile(values: Sequence[float], q: float) -> float:
    """Return a quantile, linear between order statistics; infinite if the upper one of them is.

    Of finite values it is numpy's to the bit, which of infinite ones makes NaN.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    if np.isfinite(ordered).all():
        return float(np.quantile(ordered, q))
    place = q * (len(ordered) - 1)
    below = int(place)
    low, high = ordered[below], ordered[min(below + 1, len(ordered) - 1)]
    return float(low if low == high or place == below else low + (place - below) * (high - low))
