"""Colours of a trial."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from msrr_bullet.timeline import palette
from msrr_bullet.timeline.mission_snapshot import Activity
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Phase

#: Linear RGB as seen without the cones for long and for middle wavelengths (Machado et al., 2009).
PROTANOPIA = [
    [0.152286, 1.052583, -0.204868],
    [0.114503, 0.786281, 0.099216],
    [-0.003882, -0.048116, 1.051998],
]
DEUTERANOPIA = [
    [0.367322, 0.860646, -0.227968],
    [0.280085, 0.672501, 0.047413],
    [-0.011820, 0.042940, 0.968881],
]


def linear(colour):
    rgb = np.array([(colour >> shift) & 255 for shift in (16, 8, 0)]) / 255.0
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def oklab(rgb):
    """Return linear RGB in OKLab (Ottosson, 2020), in which distances are those that eyes see."""
    lms = np.array(
        [
            [0.41222147, 0.53633254, 0.05144599],
            [0.2119035, 0.6806997, 0.1073970],
            [0.0883025, 0.2817188, 0.6299787],
        ]
    )
    lab = np.array(
        [
            [0.2104543, 0.7936178, -0.0040720],
            [1.9779985, -2.4285922, 0.4505937],
            [0.0259040, 0.7827718, -0.8086758],
        ]
    )
    return lab @ np.cbrt(lms @ np.clip(rgb, 0.0, 1.0))


def luminance(colour):
    return float(linear(colour) @ [0.2126, 0.7152, 0.0722])


def test_every_phase_and_every_activity_has_a_colour():
    assert palette.PHASE_COLOURS.keys() == set(Phase)
    assert palette.ACTIVITY_COLOURS.keys() == set(Activity)


@pytest.mark.parametrize(
    ("eyes", "least"), [(np.eye(3), 0.12), (np.array(PROTANOPIA), 0.07), (np.array(DEUTERANOPIA), 0.07)]
)
def test_sixteen_units_can_be_told_apart(eyes, least):
    assert len(palette.LED_UNITS) == 16
    seen = [oklab(eyes @ linear(colour)) for colour in palette.LED_UNITS]
    assert min(np.linalg.norm(a - b) for a, b in combinations(seen, 2)) > least


def test_units_stand_out_from_light_and_from_dark_ground():
    for colour in palette.LED_UNITS:
        y = luminance(colour)
        assert (luminance(palette.FLOOR) + 0.05) / (y + 0.05) > 1.9
        assert (y + 0.05) / (luminance(0x202020) + 0.05) > 1.9


def test_units_of_a_mission_have_colours_of_their_own_and_others_those_of_their_parts(mission_run):
    led = palette.unit_colours(mission_run.log.header.scene)
    assert len(set(led.values())) == len(led) == 4
    alone = palette.unit_colours(load_scene("two_units"))
    assert alone["a"] == palette.DOCKING_UNIT != alone["b"]
