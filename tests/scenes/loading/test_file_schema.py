"""The schemas that editors use accept what is read, and refuse what a key or a value alone makes wrong."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from msrr_scenes.errors import SceneError, UnknownNameError
from msrr_scenes.loading.file_schema import KINDS, file_schema
from msrr_scenes.loading.load import LIBRARY
from msrr_scenes.loading.tag_map_file import read_tag_map, write_tag_map
from msrr_scenes.loading.target_file import read_target
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.tag_map import MappedTagSpec, TagMapSpec

COMMITTED = LIBRARY / "scene.schema.json"
SCENES = sorted(LIBRARY.glob("*.yaml"))


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(json.loads(COMMITTED.read_text()))


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_a_schema(kind: str) -> None:
    jsonschema.Draft202012Validator.check_schema(file_schema(kind))


def test_an_unknown_kind_of_file_is_answered_with_those_there_are() -> None:
    with pytest.raises(UnknownNameError, match="scene, tag_map, target"):
        file_schema("scnee")


def test_the_committed_schema_is_that_of_the_models() -> None:
    name = COMMITTED.relative_to(Path(__file__).resolve().parents[3])
    assert json.loads(COMMITTED.read_text()) == file_schema(), f"run `msrr schema --out {name}`"


def test_every_shipped_scene_names_the_schema_and_agrees_with_it(
    validator: jsonschema.Draft202012Validator,
) -> None:
    for file in SCENES:
        first, _, _ = file.read_text().partition("\n")
        named = first.removeprefix("# yaml-language-server: $schema=")
        assert (file.parent / named).resolve() == COMMITTED, file.name
        validator.validate(yaml.safe_load(file.read_text()))


SCENE: dict[str, Any] = {
    "units": {"b": {"number": 1}, "a": {"number": 0, "pose": {"x_m": -1.0}}},
    "plan": [{"unit": "a", "to": "b.rear"}],
}


def changed(**values: Any) -> dict[str, Any]:
    return {**copy.deepcopy(SCENE), **values}


#: Every short form that a file may use, and keys that a validator fills in.
WRITTEN = {
    "a law by its name": changed(control={"docking": "c2"}),
    "parameters of the default law": changed(control={"docking": {"params": {"gain": 2}}}),
    "a renderer by its name": changed(cameras={"onboard": {"renderer": "tiny"}}),
    "a grade": changed(as_built="careful"),
    "a true error": changed(as_built={"grade": "careful", "onboard": {"yaw_deg": 2}}),
    "a tolerance": changed(as_built={"onboard": {"yaw_deg": {"sigma": 0.5}}}),
    "one limit": changed(limits={"v_max_mps": 0.2}),
    "a shape": {"units": SCENE["units"], "shape": {"line": 2}},
    "two shapes": {"units": SCENE["units"], "shape": [{"line": 2}, {"tree": {"a": "root", "b": "a.rear"}}]},
    "an assembled pair": changed(assembled=["a.front-b.rear"]),
    "steps of all kinds": changed(plan=[{"undock": "a"}, {"move": "a"}, {"unit": "a", "to": "b.left"}]),
    "a radio of defaults": changed(radio={}),
    "an overhead camera of defaults": changed(cameras={"overhead": {}}),
}


@pytest.mark.parametrize("form", WRITTEN)
def test_what_a_file_may_write_is_read_and_agrees(
    form: str, validator: jsonschema.Draft202012Validator
) -> None:
    Scene.model_validate({"name": "written", **WRITTEN[form]})
    validator.validate(WRITTEN[form])


#: A mistake, and a word of the answer that the loader gives to it.
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "an unknown key": (changed(tme_limit_s=3), "tme_limit_s"),
    "an unknown key of a part": (changed(cameras={"onboard": {"noise": 3}}), "noise"),
    "a number out of its range": (changed(time_limit_s=-1), "time_limit_s"),
    "a flag for a number": (changed(time_limit_s=True), "time_limit_s"),
    "an error out of its range": (changed(as_built={"onboard": {"yaw_deg": 50}}), "yaw_deg"),
    "an unknown grade": (changed(as_built="sloppy"), "grade"),
    "a name with a space": ({"units": {"unit a": {"number": 0}}}, "unit a"),
    "an unknown plant": (changed(plant="gazebo"), "plant"),
    "a step without a port": (changed(plan=[{"unit": "a"}]), "to"),
    "a pair without a dash": (changed(assembled=["a.front"]), "assembled"),
}


@pytest.mark.parametrize("mistake", WRONG)
def test_what_is_not_read_is_marked(mistake: str, validator: jsonschema.Draft202012Validator) -> None:
    data, word = WRONG[mistake]
    with pytest.raises(ValueError, match=word):
        Scene.model_validate({"name": "wrong", **data})
    with pytest.raises(jsonschema.ValidationError):
        validator.validate(data)


def test_a_map_of_tags_agrees_with_its_schema(tmp_path: Path) -> None:
    tag = MappedTagSpec(position_m=(0.0, 0.0, 0.0), quaternion_xyzw=(0.0, 0.0, 0.0, 1.0))
    write_tag_map(
        tmp_path / "map.yaml", TagMapSpec(family="tag36h11", tag_size_m=0.1, reference=3, tags={3: tag})
    )
    # JSON has no numbers for keys; editors take those of YAML for texts.
    data = json.loads(json.dumps(yaml.safe_load((tmp_path / "map.yaml").read_text())))
    jsonschema.validate(data, file_schema("tag_map"))


@pytest.mark.nightly
def test_a_map_of_every_tag_of_a_family_is_read_again(tmp_path: Path) -> None:
    third = 1.0 / 3.0
    tag = MappedTagSpec(position_m=(third, -third, third), quaternion_xyzw=(0.5, -0.5, 0.5, 0.5))
    written = TagMapSpec(family="tag36h11", tag_size_m=0.1, reference=3, tags=dict.fromkeys(range(587), tag))
    write_tag_map(tmp_path / "map.yaml", written)
    assert read_tag_map(tmp_path / "map.yaml") == written


@pytest.mark.parametrize("given", [("unit",), ("marker",), (), ("unit", "marker")])
def test_a_target_has_a_unit_or_a_marker(given: tuple[str, ...], tmp_path: Path) -> None:
    tags = {3: MappedTagSpec(position_m=(0.0, 0.0, 0.0), quaternion_xyzw=(0.0, 0.0, 0.0, 1.0))}
    write_tag_map(
        tmp_path / "map.yaml", TagMapSpec(family="tag36h11", tag_size_m=0.1, reference=3, tags=tags)
    )
    parts = {"unit": {"number": 1, "port": "rear"}, "marker": {"map": "map.yaml"}}
    data = {"as_built": "careful", **{part: parts[part] for part in given}}
    (tmp_path / "target.yaml").write_text(yaml.safe_dump(data))
    if len(given) == 1:
        read_target(tmp_path / "target.yaml")
        jsonschema.validate(data, file_schema("target"))
        return
    with pytest.raises(SceneError, match="either unit or marker"):
        read_target(tmp_path / "target.yaml")
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, file_schema("target"))
