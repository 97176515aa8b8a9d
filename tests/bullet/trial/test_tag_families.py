"""Families of tags in scenes: sizes that keep the prints as they are, and ids that a family has."""

from __future__ import annotations

import math
import re

import pytest

from msrr_bullet.trial.trial import Trial
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.bodies import TagsSpec
from msrr_scenes.specs.tag_families import FAMILIES


@pytest.mark.parametrize("family", FAMILIES)
def test_prints_keep_their_size(family: str) -> None:
    tags, drawn = TagsSpec.model_validate({"family": family}), TagsSpec()
    for slot in ("tag_top", "port_rear_marker_left", "port_rear_marker_middle"):
        plate, before = (t.tag_family.plate_ratio * t.size(slot) for t in (tags, drawn))
        assert math.isclose(plate, before, rel_tol=1e-12)
    given = TagsSpec.model_validate({"family": family, "side_m": 0.03})
    assert (given.side_m, given.mast_m) == (0.03, tags.mast_m)


def test_ids_that_the_family_lacks_are_named() -> None:
    with pytest.raises(SceneError, match=r"tag id 35; the family tag25h9 has 0 \.\. 34"):
        load_scene("close_range", {"tags.family": "tag25h9", "units.b.number": "3"})
    with pytest.raises(SceneError, match="tag36h11"):
        load_scene("close_range", {"tags.family": "tag36h1"})


@pytest.mark.nightly
@pytest.mark.parametrize("family", FAMILIES)
def test_units_dock_by_tags_of_every_family(family: str) -> None:
    told = {"tags.family": family, "as_built": "perfect", "units.a.number": "0", "units.b.number": "1"}
    place = re.compile(r"at setback_m (\S+), half_width_m (\S+) to the \w+\. The")
    if FAMILIES[family].white_inside:
        # The edges of the target have moved far; the message says where to.
        with pytest.raises(SceneError, match=place) as caught:
            Trial(load_scene("close_range", told), 1).run()
        setback, half_width = place.findall(str(caught.value))[0]
        told |= {"los.setback_m": setback, "los.half_width_m": half_width}
    assert Trial(load_scene("close_range", told), 1).run().outcome is Outcome.DOCKED
