"""Loading: reads and overrides scene files, and names the place of a mistake in them."""

from msrr_scenes.loading.calibration_file import read_calibration
from msrr_scenes.loading.load import check_scene, load_scene, scene_hash, shipped_scenes

__all__ = ["check_scene", "load_scene", "read_calibration", "scene_hash", "shipped_scenes"]
