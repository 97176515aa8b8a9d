"""JSON texts of values: equal bytes mean values that are equal to the bit."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from msrr_bullet.log import LogError
from msrr_bullet.log.codec import codec, to_bytes
from msrr_bullet.log.formats import format_of
from msrr_scenes.messages import TagDetection, WheelOdometry


def test_equal_bytes_mean_equal_bits() -> None:
    message_format = format_of(WheelOdometry("a", 0, 0.0, 0.0))
    texts = {
        to_bytes(message_format.encode(WheelOdometry("a", 0, x, 1.0)))
        for x in (0.0, -0.0, 5e-324, 0.1, math.nextafter(0.1, 1.0), math.inf, -math.inf, math.nan)
    }
    assert len(texts) == 8


def test_numbers_of_numpy_are_taken_as_numbers() -> None:
    odd = WheelOdometry("a", np.int64(7), np.float64(0.1), np.float32(0.5))
    message_format = format_of(odd)
    assert message_format.decode(json.loads(to_bytes(message_format.encode(odd)))) == WheelOdometry(
        "a", 7, 0.1, 0.5
    )


def test_values_without_a_json_form_are_refused() -> None:
    with pytest.raises(LogError, match="float32"):
        codec(TagDetection).encode(TagDetection(1, np.zeros((4, 2), dtype=np.float32)))
    with pytest.raises(LogError, match="not empty"):
        codec(TagDetection).encode(TagDetection(1, np.zeros((0, 2))))
    with pytest.raises(TypeError, match="no JSON form"):
        codec(complex)
