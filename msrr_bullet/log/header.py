"""Header of a log: the scene, the seed, the URDFs of the units, the versions of the packages.

A log is self-contained. The scene is stored as it was run, overrides included, together with the URDF of
every unit and the meshes of its collision shapes, so that the trial can be replayed after the folder of the
scene was changed or deleted.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

from pydantic import ValidationError

from msrr_bullet.log.codec import LogError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.geometry.urdf_file import named_file
from msrr_scenes.specs.scene import Scene
from msrr_scenes.temporary_files import room_for_temporary_files

METADATA = "msrr"

#: Name of this program in the first record of a log.
LIBRARY = "msrr-bullet"


@dataclass(frozen=True)
class LogHeader:
    """Header of a log.

    Attributes:
        scene: Scene as it was run. After reading a log, it refers to the URDFs in that log only once
            :meth:`unpacked` was called.
        seed: Seed of all random streams.
        versions: Versions of the packages by name.
        files: Contents of URDFs and meshes by their name in the log.
        urdfs: Name of the URDF in the log by the name of the unit.
        recording: Where the messages come from if not from a trial, in words; else None.
    """

    scene: Scene
    seed: int
    versions: dict[str, str]
    files: dict[str, bytes]
    urdfs: dict[str, str]
    recording: str | None = None

    @property
    def origin(self) -> str:
        """Seed of the trial, or what was recorded, in words."""
        return f"seed {self.seed}" if self.recording is None else "recording"

    @classmethod
    def of(cls, scene: Scene, seed: int, versions: dict[str, str], recording: str | None = None) -> LogHeader:
        """Build the header of a trial's log, or of one of a recording, with the files of the scene.

        Raises:
            SceneError: A URDF is missing.
            LogError: A URDF or one of its meshes cannot be read.
        """
        beside = scene.source.parent if scene.source else None
        names: dict[Path, str] = {}
        files: dict[str, bytes] = {}
        urdfs: dict[str, str] = {}
        for unit, spec in scene.units.items():
            path = find_urdf(spec.urdf, beside).resolve()
            if path not in names:
                names[path] = f"urdf/{len(names)}/{path.name}"
                files |= _bundle(path, names[path])
            urdfs[unit] = names[path]
        return cls(scene, seed, versions, files, urdfs, recording)

    @room_for_temporary_files()
    def unpacked(self, folder: Path) -> LogHeader:
        """Write the files of the log into a folder and return a header whose scene refers to these files.

        Raises:
            LogError: The log names a file outside of that folder.
        """
        for name, content in self.files.items():
            path = PurePosixPath(name)
            if path.is_absolute() or ".." in path.parts:
                raise LogError(f"the log holds a file with the unsafe name {name!r}")
            target = folder / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        units = {
            unit: spec.model_copy(update={"urdf": str(folder.resolve() / self.urdfs[unit])})
            for unit, spec in self.scene.units.items()
        }
        return replace(self, scene=self.scene.model_copy(update={"units": units, "source": None}))

    def metadata(self) -> dict[str, str]:
        """Return the header without its files as the text fields of an MCAP metadata record."""
        return {
            "scene": self.scene.model_dump_json(),
            "seed": str(self.seed),
            "versions": json.dumps(self.versions, sort_keys=True),
            "urdfs": json.dumps(self.urdfs),
            **({} if self.recording is None else {"recording": self.recording}),
        }

    @classmethod
    def from_metadata(cls, fields: dict[str, str], files: dict[str, bytes]) -> LogHeader:
        """Build the header from a metadata record and the attachments of a log.

        Raises:
            LogError: A field is missing or invalid, or the URDF of a unit is missing.
        """
        try:
            header = cls(
                scene=Scene.model_validate_json(fields["scene"]),
                seed=int(fields["seed"]),
                versions=_texts(fields["versions"]),
                files=files,
                urdfs=_texts(fields["urdfs"]),
                recording=fields.get("recording"),
            )
        except (KeyError, ValueError, TypeError) as error:
            raise LogError(f"the header of the log cannot be read: {_mismatch(fields, error)}") from error
        missing = [unit for unit in header.scene.units if header.urdfs.get(unit) not in files]
        if missing:
            raise LogError(f"the header of the log cannot be read: it holds no URDF of {', '.join(missing)}")
        return header


def _mismatch(fields: dict[str, str], error: Exception) -> str:
    """Return why fields are no header of this version, and which version wrote them if they say so."""
    message = f"{error}"
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        message = ": ".join([".".join(map(str, ("scene", *first["loc"]))), first["msg"]])
    try:
        return f"{message}; msrr-bullet {_texts(fields['versions'])['msrr-bullet']} wrote it, and reads it"
    except (KeyError, ValueError, TypeError):
        return message


def _texts(text: str) -> dict[str, str]:
    values: Any = json.loads(text)
    if not isinstance(values, dict):
        raise TypeError(f"{text!r} is not a JSON object")
    return {str(k): str(v) for k, v in values.items()}


def _bundle(urdf: Path, name: str) -> dict[str, bytes]:
    """Return the URDF and the meshes of its collision shapes, stored beside it under numbered names.

    Meshes and textures that are only seen are left out of both: no replay and no figure draws them, and where
    the log is read no package may be that they are named by.
    """
    try:
        text = urdf.read_bytes()
        root = ElementTree.fromstring(text)
        meshes = [m for c in root.iter("collision") for m in c.iter("mesh")]
        if not any("filename" in element.attrib for element in root.iter()):
            return {name: text}
        _drop_seen_files(root)
        files: dict[str, bytes] = {}
        renamed: dict[str, str] = {}
        for mesh in meshes:
            old = mesh.attrib["filename"]
            if old not in renamed:
                renamed[old] = f"{len(renamed)}_{PurePosixPath(old).name}"
                files[str(PurePosixPath(name).parent / renamed[old])] = named_file(urdf, old).read_bytes()
            mesh.set("filename", renamed[old])
        return {name: ElementTree.tostring(root), **files}
    except (OSError, ElementTree.ParseError, KeyError) as error:
        raise LogError(f"{urdf}: cannot be put into the log: {error}") from error


def _drop_seen_files(root: ElementTree.Element) -> None:
    """Remove visual shapes that are meshes, and textures, from a URDF in place."""
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            if visual.find("geometry/mesh") is not None:
                link.remove(visual)
    for material in root.iter("material"):
        for texture in material.findall("texture"):
            material.remove(texture)
