"""Lost frames: their share, blackouts, and the independence of the sequence."""

from __future__ import annotations

import pytest

from msrr_bullet.sensors.frame_dropout import FrameDropout
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.faults import CameraBlackout, Fault

PERIOD_NS = 40_000_000


def lost_frames(probability: float, faults: tuple[Fault, ...] = (), count: int = 2000) -> list[bool]:
    dropout = FrameDropout("a/onboard", probability, stream(5, "camera/a/onboard/dropout"), faults)
    frames = [dropout.next_frame(k * PERIOD_NS) for k in range(count)]
    assert [number for number, _ in frames] == list(range(count))
    return [lost for _, lost in frames]


@pytest.mark.parametrize("probability", [0.0, 0.3, 1.0])
def test_the_share_of_lost_frames_is_the_probability(probability: float) -> None:
    """2000 frames: at 30 % the interval of 5 standard errors is left once in 1.7 million seeds."""
    assert sum(lost_frames(probability)) == pytest.approx(2000 * probability, abs=103 * (0 < probability < 1))


def test_a_blackout_loses_all_frames_of_its_camera_and_moves_no_other_loss() -> None:
    dark = CameraBlackout(kind="camera_blackout", camera="a/onboard", from_s=10.0, to_s=20.0)
    other = CameraBlackout(kind="camera_blackout", camera="overhead", from_s=30.0, to_s=40.0)
    plain, black = lost_frames(0.3), lost_frames(0.3, (dark, other))
    assert all(black[250:500])  # frames at 10 s up to just before 20 s
    assert black[:250] == plain[:250]
    assert black[500:] == plain[500:]


def test_a_higher_probability_loses_the_frames_of_a_lower_one_and_more() -> None:
    few, many = lost_frames(0.1), lost_frames(0.4)
    assert all(m for f, m in zip(few, many, strict=True) if f)
    assert sum(many) > sum(few)
