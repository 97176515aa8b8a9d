"""What a scene is: validated specifications, planar and spatial poses, and the messages between rooms."""

from msrr_scenes.loading.load import check_scene, load_scene, scene_hash

__all__ = ["check_scene", "load_scene", "scene_hash"]
