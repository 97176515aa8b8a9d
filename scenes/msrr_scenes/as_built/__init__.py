"""The truth of a trial beside the drawing: every camera, tag, wheel and floor as it was built.

What runs on a robot cannot reach this package; an import contract keeps it.
"""

from msrr_scenes.as_built.as_built import AsBuilt, BuiltCamera, BuiltDrive, BuiltFloor, BuiltTag, BuiltUnit
from msrr_scenes.as_built.draw import JOINT_SPACING_M, as_designed, draw_as_built

__all__ = [
    "JOINT_SPACING_M",
    "AsBuilt",
    "BuiltCamera",
    "BuiltDrive",
    "BuiltFloor",
    "BuiltTag",
    "BuiltUnit",
    "as_designed",
    "draw_as_built",
]
