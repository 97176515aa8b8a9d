"""Header of a log: scene, seed, and the files that the scene refers to."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.log import LogError, LogHeader, read_log
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_scenes.specs.scene import Scene
from tests.bullet.log.conftest import bits


def test_the_header_gives_back_scene_seed_and_geometry(
    tmp_path: Path, scene: Scene, header: LogHeader
) -> None:
    with McapRecorder(tmp_path / "t.mcap", header):
        pass
    read = read_log(tmp_path / "t.mcap").header
    assert (read.seed, read.versions) == (17, header.versions)
    assert read.scene == scene
    assert list(read.scene.units) == ["b", "a"]  # the order of the scene file
    unpacked = read.unpacked(tmp_path / "files").scene
    for unit in scene.units:
        there, here = unpacked.geometry(unit), scene.geometry(unit)
        assert there.urdf.is_relative_to(tmp_path)
        assert there.frames.keys() == here.frames.keys()
        assert all(bits(there.frames[k]) == bits(here.frames[k]) for k in here.frames)


@pytest.mark.parametrize("mesh", ["../nose.obj", "package://mine/nose.obj"])
def test_a_urdf_is_stored_with_its_meshes(tmp_path: Path, scene: Scene, mesh: str) -> None:
    """By whatever name; the log is read where neither the package nor the meshes that are only seen are."""
    home = tmp_path / "mine" / "robots"
    home.mkdir(parents=True)
    (tmp_path / "mine" / "nose.obj").write_text("v 0 0 0\nv 0.15 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 2 3\n")
    text = scene.geometry("a").urdf.read_text()
    shape = f'<geometry><mesh filename="{mesh}"/></geometry>'
    paint = '<material name="paint"><texture filename="package://mine/paint.png"/></material>'
    nose = (
        f'<link name="nose"><visual>{shape}{paint}</visual><collision>{shape}</collision></link>'
        '<joint name="nose" type="fixed"><parent link="axle"/><child link="nose"/></joint>'
    )
    (home / "own.urdf").write_text(text.replace("</robot>", f"{nose}</robot>"))
    units = {"a": scene.units["a"].model_copy(update={"urdf": "own.urdf"}), "b": scene.units["b"]}
    own = scene.model_copy(update={"units": units, "source": home / "scene.yaml"})
    with McapRecorder(tmp_path / "t.mcap", LogHeader.of(own, 0, {})):
        pass
    footprint = own.geometry("a").footprint
    for path in sorted((tmp_path / "mine").rglob("*.*")):
        path.unlink()
    back = read_log(tmp_path / "t.mcap").header.unpacked(tmp_path / "files").scene
    assert np.array_equal(back.geometry("a").footprint, footprint)
    assert back.geometry("a").circumradius > 0.14


def test_a_log_of_another_version_is_refused_with_that_version(header: LogHeader) -> None:
    fields = {**header.metadata(), "versions": '{"msrr-bullet": "9.1"}'}
    fields["scene"] = fields["scene"].replace('"limits":{', '"limits":{"of_9_1":1,')
    said = r"^the header .*: scene\.limits\.of_9_1: Extra inputs are not permitted; msrr-bullet 9\.1 wrote it"
    with pytest.raises(LogError, match=said) as refused:
        LogHeader.from_metadata(fields, {})
    assert "pydantic" not in str(refused.value)
    with pytest.raises(LogError, match=r"the header of the log cannot be read: 'seed'$"):
        LogHeader.from_metadata({"scene": header.metadata()["scene"]}, {})


def test_a_header_that_holds_no_urdf_of_a_unit_is_refused(header: LogHeader) -> None:
    fields = header.metadata()
    for damaged in ({"urdfs": fields["urdfs"].replace('"b"', '"f"')}, {"urdfs": "{}"}):
        with pytest.raises(
            LogError, match=r"the header of the log cannot be read: it holds no URDF of (a, )?b"
        ):
            LogHeader.from_metadata({**fields, **damaged}, header.files)
    with pytest.raises(LogError, match="it holds no URDF of"):
        LogHeader.from_metadata(fields, {})


def test_a_file_name_outside_of_the_folder_is_refused(tmp_path: Path, header: LogHeader) -> None:
    for name in ("../evil", "/tmp/evil", "a/../../evil"):
        bad = dataclasses.replace(header, files={name: b""})
        with pytest.raises(LogError, match="unsafe"):
            bad.unpacked(tmp_path / "files")
