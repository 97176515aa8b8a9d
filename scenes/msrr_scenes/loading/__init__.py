"""Loading: scene files read, overridden and checked, every mistake answered with place, key and mend."""

from msrr_scenes.loading.calibration_file import read_calibration
from msrr_scenes.loading.load import check_scene, load_scene, scene_hash, shipped_scenes

__all__ = ["check_scene", "load_scene", "read_calibration", "scene_hash", "shipped_scenes"]
