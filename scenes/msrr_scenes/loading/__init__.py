"""Loading: reads, overrides and checks scene files; names place and key of a mistake, and how to mend it."""

from msrr_scenes.loading.calibration_file import read_calibration
from msrr_scenes.loading.load import check_scene, load_scene, scene_hash, shipped_scenes

__all__ = ["check_scene", "load_scene", "read_calibration", "scene_hash", "shipped_scenes"]
