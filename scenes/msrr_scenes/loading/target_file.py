"""Target files: what a robot docks to in a recording, read, checked, and turned into a :class:`Scene`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from msrr_scenes.checks.problems import Problem
from msrr_scenes.checks.references import unknown_slots
from msrr_scenes.errors import GeometryError, SceneError, nearest
from msrr_scenes.geometry.derived_urdf import fixture_urdf, marker_slot, with_camera
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.loading.calibration_file import read_calibration
from msrr_scenes.loading.embedded_files import embed_file
from msrr_scenes.loading.load import plain_name, read_document, refuse, validated
from msrr_scenes.loading.tag_map_file import read_tag_map
from msrr_scenes.loading.yaml_document import YamlDocument
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CalibrationSpec
from msrr_scenes.specs.target import (
    DOCK,
    ROBOT,
    TARGET,
    MappedMarkerSpec,
    RobotSpec,
    TargetSpec,
    TargetUnitSpec,
)
from msrr_scenes.temporary_files import room_for_temporary_files

#: Keys of a target that mean the same in a scene.
_SHARED = ("odometry", "as_built", "los", "control", "description")

#: Keys of ``control`` that act on a recording.
_OF_PERCEPTION = {"estimator", "detector", "delay_compensation"}


def read_target(path: Path) -> TargetSpec:
    """Read a target file.

    Raises:
        SceneError: The file cannot be used; one message lists every problem with place and key.
    """
    document = read_document(path)
    embed_file(document, ("camera", "calibration"), path.parent, read_calibration)
    embed_file(document, ("marker", "map"), path.parent, read_tag_map)
    spec = validated(TargetSpec, document)
    refuse(document, [*_missing(spec, path.parent), *_without_effect(spec)])
    return spec


def _missing(spec: TargetSpec, beside: Path) -> Iterator[Problem]:
    """Yield the URDFs that cannot be had, and the ports and links with a tag that they do not have."""
    named: dict[str, RobotSpec | TargetUnitSpec] = {"robot": spec.robot}
    if spec.unit is not None:
        named["unit"] = spec.unit
    for key, part in named.items():
        try:
            geometry = read_unit(find_urdf(part.urdf, beside).resolve())
        except (GeometryError, SceneError) as error:
            yield Problem((key, "urdf"), str(error))
            continue
        marked = isinstance(part, TargetUnitSpec)
        ports = geometry.passive_ports if marked else geometry.ports
        if part.port not in ports:
            text = f"{part.port!r} is no port of {geometry.urdf.name}{' with a marker' if marked else ''}"
            yield Problem((key, "port"), f"{text}{nearest(part.port, ports)} Known: {', '.join(ports)}")
        if isinstance(part, TargetUnitSpec):
            yield from unknown_slots((key, "tag_ids"), part.tag_ids, geometry.tag_slots)


def _without_effect(spec: TargetSpec) -> Iterator[Problem]:
    """Yield what changes nothing in a recording."""
    for key in sorted(spec.control.model_fields_set - _OF_PERCEPTION):
        yield Problem(("control", key), "changes nothing, for a recording is not controlled; leave it out")
    for group, quantity, deviation in spec.as_built.deviations():
        if deviation.error is not None:
            text = "changes nothing, for a recording has its own true errors; give a tolerance, {sigma: ...}"
            yield Problem(("as_built", group, quantity), text)
    if spec.marker is not None and "tags" in spec.model_fields_set:
        yield Problem(("tags",), "changes nothing, for a map has family and size of its tags; leave it out")
    for key in spec.los.model_fields_set & {"half_width_m", "setback_m"} if spec.marker is not None else ():
        text = "changes nothing, for the outermost edges of mapped tags are the target; leave it out"
        yield Problem(("los", key), text)


@room_for_temporary_files()
def target_scene(spec: TargetSpec, path: Path, folder: Path, calibration: CalibrationSpec | None) -> Scene:
    """Return the scene of a recording: a robot and its target, with the dock frame D as the world.

    The file of the target, ``path``, names the scene, and URDFs are looked for beside it. Those that are made
    are written to ``folder``, which exists. Without a calibration the camera has that of the target.

    Raises:
        SceneError: A URDF is missing, or nothing tells of the camera.
        GeometryError: A URDF cannot be used.
    """
    given = spec.model_dump(exclude_unset=True)
    beside = path.parent
    units: dict[str, Any] = {ROBOT: {"number": 0, "urdf": str(_robot_urdf(spec, beside, folder))}}
    tags = given.get("tags", {})
    if spec.unit is not None:
        units[TARGET], port = _drawn_unit(spec.unit, beside), spec.unit.port
    else:
        assert spec.marker is not None  # one of both is given
        units[TARGET], port = _fixture(spec.marker, folder), DOCK
        tags = {"family": spec.marker.map.family, "side_m": spec.marker.map.tag_size_m}
    units[ROBOT]["number"] = 1 if units[TARGET]["number"] == 0 else 0
    data = {
        "name": plain_name(path.stem),
        "units": units,
        "cameras": {"onboard": _camera(given.get("camera", {}), calibration, path)},
        "tags": tags,
        "plan": [{"unit": ROBOT, "port": spec.robot.port, "to": f"{TARGET}.{port}"}],
        **{key: given[key] for key in _SHARED if key in given},
    }
    origins = {key: at for key, at in read_document(path).origins.items() if key and key[0] in _SHARED}
    document = YamlDocument(data, {**origins, (): str(path)})
    return validated(Scene, document).read_from(None, document.origins)


def _robot_urdf(spec: TargetSpec, beside: Path, folder: Path) -> Path:
    urdf = find_urdf(spec.robot.urdf, beside).resolve()
    if spec.robot.camera is None:
        return urdf
    mounted = folder / f"{ROBOT}.urdf"
    mounted.write_text(with_camera(urdf, spec.robot.camera.X), encoding="utf-8")
    return mounted


def _drawn_unit(unit: TargetUnitSpec, beside: Path) -> dict[str, Any]:
    """Return a unit whose port has the world as its dock frame."""
    urdf = find_urdf(unit.urdf, beside).resolve()
    geometry = read_unit(urdf)
    X_DU = geometry.dock_frame(unit.port).inverse()
    pose = {"x_m": X_DU.x, "y_m": X_DU.y, "yaw_deg": math.degrees(X_DU.yaw)}
    return {"number": unit.number, "urdf": str(urdf), "tag_ids": unit.tag_ids, "pose": pose}


def _fixture(marker: MappedMarkerSpec, folder: Path) -> dict[str, Any]:
    """Write the URDF of a fixture with the tags of a map, and return the unit that it is."""
    X_DT = marker.X_DT
    urdf = folder / f"{TARGET}.urdf"
    urdf.write_text(fixture_urdf(DOCK, X_DT, marker.map.tag_size_m), encoding="utf-8")
    return {"number": 0, "urdf": str(urdf), "tag_ids": {marker_slot(DOCK, tag): tag for tag in X_DT}}


def _camera(given: dict[str, Any], calibration: CalibrationSpec | None, path: Path) -> dict[str, Any]:
    """Return the camera with the calibration that holds, and the size of the pictures it was made of."""
    camera = dict(given)
    if calibration is not None:
        camera["calibration"] = calibration.model_dump()
    told = camera.get("calibration")
    if told is None and "hfov_deg" not in camera:
        raise SceneError(
            f"{path}: nothing tells of the camera; give --calibration FILE, or in it camera.calibration, or"
            " camera.hfov_deg of an ideal camera"
        )
    for key in ("width_px", "height_px"):
        if told is not None and told.get(key) is not None:
            camera[key] = told[key]
    return camera
