"""Colours and lengths that all drawings of a trial have in common.

The colours stay apart for colour-blind eyes (Okabe and Ito, Color Universal Design, 2008).
"""

from __future__ import annotations

from msrr_scenes.messages import Phase

BLUE, SKY, GREEN, ORANGE = 0x0072B2, 0x56B4E9, 0x009E73, 0xE69F00
VERMILLION, PURPLE, YELLOW, BLACK = 0xD55E00, 0xCC79A7, 0xF0E442, 0x000000

DOCKING_UNIT = SKY
OTHER_UNITS = (0x8FA3AD, 0x7FB8A4, 0xB7A6C9)
TYRE = 0x2B2B2B
OBSTACLE = 0xB9A76A
#: Driven path, estimates of the robot, smallest clearance, and a clearance at which the collision monitor
#: acts.
PATH, BELIEF, CLEARANCE, ALARM = BLUE, ORANGE, PURPLE, VERMILLION
#: Line of sight, tags as detected, and windows read from a frame.
SIGHT, DETECTION, WINDOW = GREEN, VERMILLION, SKY
#: Planned path with the desired point on it, and bounds of the line-of-sight cone.
PLAN = CONE = 0x37424D
FLOOR, GRID, DARK = 0xF3F4F6, 0xD3D8DE, 0x8A939C

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

#: Length to which lines of sight are drawn on the floor [m].
SIGHT_RANGE = 0.7


def unit_colour(index: int, docks: bool) -> int:
    """Return the colour of the unit that is number ``index`` in the scene."""
    return DOCKING_UNIT if docks else OTHER_UNITS[index % len(OTHER_UNITS)]


def link_colour(link: str, unit_colour: int) -> int:
    """Return the colour of a link of a unit's URDF: wheels and casters are black."""
    return TYRE if link.startswith(("wheel", "caster")) else unit_colour


def css(colour: int) -> str:
    """Return a colour as ``#rrggbb``."""
    return f"#{colour:06x}"
