"""Tag families: what scenes know of them is what the library says."""

from __future__ import annotations

import pytest

from msrr_perception.detection import native_apriltag
from msrr_perception.detection.detector import PupilDetector, scene_detector
from msrr_perception.detection.native_apriltag import DetectorError
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.tag_families import FAMILIES, TagFamily


@pytest.mark.parametrize("family", FAMILIES.values(), ids=lambda family: family.name)
def test_families_are_those_of_the_library(family: TagFamily) -> None:
    theirs = native_apriltag._printed_family(family.name)
    assert theirs.name.decode() == family.name
    for field in ("edge_modules", "plate_modules", "white_inside", "distance"):
        assert getattr(theirs, field) == getattr(family, field)
    assert theirs.tags == family.ids
    bits = native_apriltag.tag_bitmap(family.name, 0)
    assert bits.shape == (family.plate_modules, family.plate_modules)
    assert not (bits == bits[::-1, ::-1]).all()


def test_ids_outside_a_family_are_refused() -> None:
    with pytest.raises(DetectorError, match=r"tag16h5, which has ids 0 \.\. 29"):
        native_apriltag.tag_bitmap("tag16h5", 30)


def test_a_scene_is_read_with_its_family(scene: Scene) -> None:
    """A family that a scene gives the detector itself counts more; short codes are not corrected."""
    assert getattr(scene_detector(scene), "family", None) == "tag36h11"
    tags = scene.tags.model_copy(update={"family": "tag16h5"})
    detector = scene_detector(scene.model_copy(update={"tags": tags}))
    assert isinstance(detector, PupilDetector)
    assert (detector.family, detector.max_hamming) == ("tag16h5", 0)
    choice = scene.control.detector.model_copy(update={"params": {"family": "tag25h9"}})
    other = scene.model_copy(update={"control": scene.control.model_copy(update={"detector": choice})})
    assert getattr(scene_detector(other), "family", None) == "tag25h9"
