"""Specifications: the frozen, validated models of everything that a scene file can say.

One field of a model is one key of a scene file, and the docstring below the field describes the key. The
root exports the specifications that other packages are built with; the rest is imported from its module.
"""

from msrr_scenes.specs.bodies import ArenaSpec, ObstacleSpec
from msrr_scenes.specs.control import DockingSpec, LosSpec
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec, OdometrySpec
from msrr_scenes.specs.spec import Choice, PoseSpec, Spec
from msrr_scenes.specs.vehicle import LimitsSpec

__all__ = [
    "ArenaSpec",
    "CameraSpec",
    "Choice",
    "DockStep",
    "DockingSpec",
    "LimitsSpec",
    "LosSpec",
    "ObstacleSpec",
    "OdometrySpec",
    "PoseSpec",
    "Scene",
    "Spec",
]
