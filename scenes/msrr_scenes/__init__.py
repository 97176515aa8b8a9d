"""Scenes: what a scene is, how it is read and checked, and the messages that robot and trial exchange."""

from msrr_scenes.loading import check_scene, load_scene, read_calibration, scene_hash, shipped_scenes

__all__ = ["check_scene", "load_scene", "read_calibration", "scene_hash", "shipped_scenes"]
