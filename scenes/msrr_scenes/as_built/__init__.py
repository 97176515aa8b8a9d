"""As built: true values of cameras, tags, wheels and floor in a trial, beside those that robots are told.

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
