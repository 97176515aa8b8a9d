"""The parts of the frame that the overhead search takes in turn; the tests of the robot cover the rest."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.detection.windows import search_windows
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.specs.scene import Scene


@pytest.mark.parametrize("parts", [1, 2, 3, 5, 8])
def test_every_tag_lies_wholly_in_one_part_of_the_search(scene: Scene, parts: int) -> None:
    arena = Scene.model_validate({**scene.model_dump(), "cameras": {"overhead": {}}})
    model = OverheadModel.from_scene(arena, ("a", "b"))
    windows = search_windows(model, parts)
    assert len(windows) == parts
    size = int(np.ceil(1.2 * model.largest_tag_px))
    for x in range(model.camera.width - size):
        assert any(w.x <= x and x + size <= w.x_end for w in windows), x
    assert all(w.x % 4 == 0 and w.height == model.camera.height for w in windows)
