"""Colours of a trial."""

from __future__ import annotations

from msrr_bullet.timeline import palette
from msrr_scenes.messages import Phase


def test_every_phase_has_a_colour():
    assert palette.PHASE_COLOURS.keys() == set(Phase)
