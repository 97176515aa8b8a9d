"""Scenes: what a scene is, how it is read and checked, and the messages that robot and trial exchange.

The names are loaded when they are first asked for: a program that only wants an error class from here, as one
that prints its help does, need not wait for the models of a scene.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from msrr_scenes.loading import check_scene, load_scene, read_calibration, scene_hash, shipped_scenes

__all__ = ["check_scene", "load_scene", "read_calibration", "scene_hash", "shipped_scenes"]


def __getattr__(name: str) -> Any:
    if name in __all__:
        from msrr_scenes import loading

        return getattr(loading, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
