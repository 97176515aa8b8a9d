"""Colours that stay apart for colour-blind eyes (Okabe and Ito, Color Universal Design, 2008)."""

from __future__ import annotations

from msrr_scenes.messages import Phase

BLUE, SKY, GREEN, ORANGE = 0x0072B2, 0x56B4E9, 0x009E73, 0xE69F00
VERMILLION, PURPLE, YELLOW, BLACK = 0xD55E00, 0xCC79A7, 0xF0E442, 0x000000

DOCKING_UNIT = SKY
OTHER_UNITS = (0x8FA3AD, 0x7FB8A4, 0xB7A6C9)
TYRE = 0x2B2B2B
OBSTACLE = 0xB9A76A
PATH = BLUE
BELIEF = ORANGE
CLEARANCE = PURPLE
#: Clearance at which the guard acts.
ALARM = VERMILLION
SIGHT = GREEN
#: Tags as detected, and windows read from a frame.
DETECTION, WINDOW = VERMILLION, SKY
#: The path that the unit means to drive, and where on it it should be.
PLAN = 0x37424D
FLOOR, GRID, DARK = 0xF3F4F6, 0xD3D8DE, 0x8A939C
#: Top and bottom of the background, RGB in [0, 1].
BACKGROUND = ((0.93, 0.95, 0.97), (0.80, 0.84, 0.88))

#: Pale colours behind text and curves.
PHASE_COLOURS = {
    Phase.ASSEMBLE: 0xE3E6EA,
    Phase.HAND_OVER: 0xFBF3C4,
    Phase.DOCK: 0xCFE6F5,
    Phase.LOCK: 0xF3DCEA,
    Phase.VERIFY: 0xCDEBDF,
    Phase.RETREAT: 0xF8DCC8,
    Phase.DONE: 0x9FD8C3,
    Phase.FAILED: 0xE8A98A,
}


def unit_colour(index: int, docks: bool) -> int:
    """Return the colour of the unit that is number ``index`` in the scene."""
    return DOCKING_UNIT if docks else OTHER_UNITS[index % len(OTHER_UNITS)]


def css(colour: int) -> str:
    """Return a colour as ``#rrggbb``."""
    return f"#{colour:06x}"
