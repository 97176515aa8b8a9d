"""Colours and lengths that all drawings of a trial have in common.

The colours stay apart for colour-blind eyes (Okabe and Ito, Color Universal Design, 2008).
"""

from __future__ import annotations

from msrr_bullet.timeline.mission_snapshot import Activity
from msrr_scenes.messages import Phase
from msrr_scenes.specs.scene import Scene

BLUE, SKY, GREEN, ORANGE = 0x0072B2, 0x56B4E9, 0x009E73, 0xE69F00
VERMILLION, PURPLE, BLACK = 0xD55E00, 0xCC79A7, 0x000000

DOCKING_UNIT = SKY
OTHER_UNITS = (0x8FA3AD, 0x7FB8A4, 0xB7A6C9)
#: Units that a base station leads. All are neither light nor dark, so that they can be told from white and
#: from dark ground, and any two differ by 0.12 or more in OKLab, for colour-blind eyes by 0.07 or more; both
#: were maximized.
LED_UNITS = (
    *(0x4884CC, 0xF03C60, 0x249060, 0x9C00C0, 0x907800, 0xF084C0, 0x186084, 0x90B478),
    *(0xFC840C, 0x9C3C00, 0x9C9CFC, 0xA8186C, 0x9060FC, 0x9C6C9C, 0xFC0CC0, 0x6C00FC),
)
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
#: What takes the place of colours on a dark page, and the top and the bottom of the background on a light and
#: on a dark one.
IN_THE_DARK = {FLOOR: 0x3F464D, GRID: 0x2A3036, PLAN: 0xC3CED9, PATH: 0x4FA9E0}
BACKGROUNDS = ((0xEDF2F7, 0xCCD6E0), (0x1C242B, 0x0D1217))

#: Pale colours behind text and curves.
PHASE_COLOURS = {
    Phase.ASSEMBLE: 0xE3E6EA,
    Phase.HAND_OVER: 0xFBF3C4,
    Phase.DOCK: 0xCFE6F5,
    Phase.LOCK: 0xF3DCEA,
    Phase.VERIFY: 0xCDEBDF,
    Phase.TUG_TEST: 0xB7E3E0,
    Phase.CALIBRATE: 0xE8E0F4,
    Phase.RETREAT: 0xF8DCC8,
    Phase.DONE: 0x9FD8C3,
    Phase.FAILED: 0xE8A98A,
}

#: Pale colours of what the units of a mission do.
ACTIVITY_COLOURS = {
    Activity.STANDING: 0xE9ECEF,
    Activity.WAITING: 0xE9ECEF,  # hatched, or marked by an arrow
    Activity.DRIVING: 0xBFDDF2,
    Activity.DOCKING: 0xF6DFA4,
    Activity.IN_PLACE: 0x9FD8C3,
    Activity.LOST: 0xF8DCC8,
    Activity.FAILED: 0xE8A98A,
}

#: Length to which lines of sight are drawn on the floor [m].
SIGHT_RANGE = 0.7

#: Direction in W from a scene to the camera that shows it as a whole: from the left, behind and above.
VIEW_FROM = (-0.42, 0.72, 0.55)


def unit_colours(scene: Scene) -> dict[str, int]:
    """Return the colour of every unit: one of its own in a mission of a base station, else by its part."""
    if scene.coordinated:
        return {unit: LED_UNITS[index % len(LED_UNITS)] for index, unit in enumerate(scene.units)}
    docking = {step.unit for step in scene.docks}
    return {
        unit: DOCKING_UNIT if unit in docking else OTHER_UNITS[index % len(OTHER_UNITS)]
        for index, unit in enumerate(scene.units)
    }


def link_colour(link: str, unit_colour: int) -> int:
    """Return the colour of a link of a unit's URDF: wheels and casters are black."""
    return TYRE if link.startswith(("wheel", "caster")) else unit_colour


def css(colour: int) -> str:
    """Return a colour as ``#rrggbb``."""
    return f"#{colour:06x}"
